"""Keeps a stage on disk while the edge runs, and restores it at the next start."""

from __future__ import annotations

import hashlib
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Protocol

import msgspec
import numpy as np

from enliven.document import Character
from enliven.errors import EnlivenError, find_plain_reason
from enliven.files import DAMAGE
from enliven.possession import Actor
from enliven.supervision.closeable import Closeable
from enliven.wire import PutCharacter
from enliven_edge.kept_stage.folder import StageFolder
from enliven_edge.kept_stage.state import KeptCharacter, StageState, StartJournal
from enliven_edge.settings import EdgeSettings

if TYPE_CHECKING:
    from enliven_edge.character_upload import CharacterUploads
    from enliven_edge.physics.switch import PhysicsSwitch
    from enliven_edge.stage.stage import Stage
    from enliven_edge.tracking.tracker import Tracker

log = logging.getLogger(__name__)

MAX_CRASHES = 2
"""Maximum number of starts that may crash while a character is being restored. After that, the character is
no longer restored."""
_COMPARE_INTERVAL_S = 0.2
"""Seconds between two comparisons of the stage with the written state. The interval is too short to be
noticed."""
_WRITE_INTERVAL_S = 0.5
"""Minimum seconds between two writes. The limit is needed, because a gesture changes a size in every
frame."""
_RETRY_INTERVAL_S = 5.0
"""Seconds between a failed write and the next attempt."""
_TRIAL_S = 1.0
"""Seconds for which each restored character must run before the next one is restored, if the last start
crashed."""
_START_S = 10.0
"""Seconds after which a start counts as successful."""
_CLOSE_TIMEOUT_S = 5.0
"""Maximum seconds for which closing waits for the last write."""


class KeptEdge(Protocol):
    """The parts of the edge that have a kept state."""

    stage: Stage
    uploads: CharacterUploads
    tracker: Tracker
    physics: PhysicsSwitch


class StageKeeper(Closeable):
    """Writes the state of a stage to a folder whenever it has changed, and restores it once at the start.

    It stores the characters of viewers and of scans, removed initial characters, sizes, overshoots,
    smoothing, the lock, and the physics world. Possessions are not kept, because the tracker does not
    recognise people after a restart. For the same reason, a lock on the cast is restored as soon as the same
    number of people perform.

    A character that crashed the edge twice while it was restored is no longer restored, and its data file is
    renamed. If the folder cannot be read or written, this is reported, and the edge runs without it.

    Args:
        folder: the folder with the files.
        initial: the mesh of each initial character, by id.
        settings: the settings for creating actors, and of the initial physics world.
        clock: returns seconds, for tests.
    """

    def __init__(
        self,
        folder: StageFolder,
        initial: Mapping[str, str],
        settings: EdgeSettings | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._folder, self._initial, self._clock = folder, dict(initial), clock
        self._settings = settings or EdgeSettings()
        self.state = folder.read()
        self._journal = folder.read_journal()
        self._edge: KeptEdge | None = None
        self._pending: deque[tuple[KeptCharacter, Actor]] = deque()
        self._started_at = self._next_trial_at = clock()
        self._compared_at = -np.inf
        self._lock_at: int | None = None
        self._initial_smoothing: dict[int, float] = {}
        self._fingerprint: tuple[Any, ...] | None = None
        self._writer = _StageWriter(folder, self.state)

    def is_removed(self, character: str) -> bool:
        """Returns True if an initial character was removed from the stage before the restart."""
        mesh = self._initial.get(character)
        return mesh is not None and self.state.removed.get(character) == mesh

    def restore(self, edge: KeptEdge) -> None:
        """Restores the kept state of the edge, and starts to track its changes. Call it before the loop."""
        self._edge = edge
        self._initial_smoothing = edge.tracker.output.amounts
        edge.uploads.on_shown = self._writer.add_data
        is_careful = self._begin_journal()
        prepared = [
            (character, actor) for character in self.state.characters if (actor := self._prepare(character))
        ]
        if is_careful and prepared:
            log.warning("the last start crashed, so the saved characters are restored one at a time")
            self._pending.extend(prepared)
        else:
            for character, actor in prepared:
                self._restore_character(character, actor)
            edge.stage.sort([character.id for character in self.state.characters])
        self._update_journal("", is_starting=True)
        for character in self.state.characters:
            if not character.digest and character.id in edge.stage.actors:
                _restore_place(edge.stage.actors[character.id], character)
        self._restore_switches(edge)

    def follow(self, performers: int) -> None:
        """Writes changes of the stage in the background. Call it once per iteration of the main loop.

        Args:
            performers: current number of performers.
        """
        edge, now = self._edge, self._clock()
        if edge is None:
            return
        if self._lock_at is not None and performers >= self._lock_at:
            self._lock_at = None
            edge.tracker.lock()
        if self._pending:
            self._restore_next(now)
        elif self._journal.is_starting and now - self._started_at >= _START_S:
            self._end_start()
        if not self._pending and now - self._compared_at >= _COMPARE_INTERVAL_S:
            self._compared_at = now
            self._write_changes(edge)

    def close(self) -> None:
        """Writes the last changes. A second call does nothing."""
        if self._edge is not None:
            if not self._pending:
                self._write_changes(self._edge)
            self._end_start()
            self._edge.uploads.on_shown = None
            self._edge = None
        self._writer.close()

    def _begin_journal(self) -> bool:
        """Counts a crash of the last start. Returns True if characters must be restored one by one."""
        journal = self._journal
        if journal.current:
            journal.crashes[journal.current] = journal.crashes.get(journal.current, 0) + 1
        kept_digests = {character.digest for character in self.state.characters}
        journal.crashes = {
            digest: count for digest, count in journal.crashes.items() if digest in kept_digests
        }
        return journal.is_starting

    def _prepare(self, kept: KeptCharacter) -> Actor | None:
        """Returns the actor of a character that a viewer sent.

        Returns None for an initial character, or if the character cannot be used.
        """
        if not kept.digest:
            return None
        if self._journal.crashes.get(kept.digest, 0) >= MAX_CRASHES:
            log.warning(
                "the saved character %s is not restored: the edge crashed %d times while restoring it. To "
                "try again, send the character again.",
                kept.id,
                MAX_CRASHES,
            )
            self._folder.set_character_aside(kept.digest, "the edge crashed while restoring this character")
            return None
        # Import it here, because an edge without kept characters does not need it.
        from enliven_edge.uploaded_actor import create_uploaded_actor

        self._update_journal(kept.digest, is_starting=True)
        try:
            data = self._folder.read_character(kept.digest)
            return create_uploaded_actor(data, _order_from_kept(kept), self._settings)
        except EnlivenError as error:
            reason = str(error)
        except (*DAMAGE, RuntimeError) as error:
            reason = f"the character is damaged: {find_plain_reason(error)}"
        log.warning("the saved character %s is not restored (%s)", kept.id, reason)
        self._folder.set_character_aside(kept.digest, reason)
        return None

    def _restore_character(self, kept: KeptCharacter, actor: Actor) -> None:
        """Puts a restored character on the stage."""
        assert self._edge is not None
        self._edge.uploads.restore(_order_from_kept(kept), actor)
        _restore_place(actor, kept)

    def _restore_next(self, now: float) -> None:
        """Puts the next character on the stage after the previous one has run for a while."""
        if now < self._next_trial_at:
            return
        character, actor = self._pending.popleft()
        self._update_journal(character.digest, is_starting=True)
        self._restore_character(character, actor)
        self._started_at = now - _START_S + _TRIAL_S
        self._next_trial_at = now + _TRIAL_S

    def _restore_switches(self, edge: KeptEdge) -> None:
        state = self.state
        if state.smoothing is not None:
            edge.tracker.output.amounts = {int(body): amount for body, amount in state.smoothing.items()}
        self._lock_at = state.locked
        initial = self._settings.physics.world
        if state.initial_world == initial and state.world != edge.physics.world:
            try:
                edge.physics.switch_to(state.world)
            except EnlivenError as error:
                log.warning("the physics objects cannot be restored (%s)", error)

    def _write_changes(self, edge: KeptEdge) -> None:
        """Passes the state to the writer if it has changed.

        The comparison is much cheaper than capturing the state.
        """
        fingerprint = (
            [
                (name, id(a.character), a.growth, a.exaggeration, a.aside)
                for name, a in edge.stage.actors.items()
            ],
            edge.uploads.orders,
            edge.tracker.output.amounts,
            edge.tracker.locked_ids,
            self._lock_at,
            edge.physics.world,
        )
        if fingerprint != self._fingerprint:
            self._fingerprint = fingerprint
            self._writer.set_state(self.capture_state(edge), self._find_scanned_characters(edge))

    def capture_state(self, edge: KeptEdge) -> StageState:
        """Returns the current state. The writer adds scanned characters."""
        orders = edge.uploads.orders
        characters = tuple(
            _make_kept_character(name, actor, orders.get(name)) for name, actor in edge.stage.actors.items()
        )
        amounts = edge.tracker.output.amounts
        locked = len(edge.tracker.locked_ids) if edge.tracker.locked_ids is not None else self._lock_at
        return StageState(
            characters=characters,
            removed={name: mesh for name, mesh in self._initial.items() if name not in edge.stage.actors},
            smoothing=None
            if amounts == self._initial_smoothing
            else {str(body): amount for body, amount in amounts.items()},
            locked=locked,
            initial_world=self._settings.physics.world,
            world=edge.physics.world,
        )

    def _find_scanned_characters(self, edge: KeptEdge) -> dict[str, Character]:
        """Returns the characters that were made by scans, by id."""
        other_names = edge.uploads.orders.keys() | self._initial.keys()
        return {name: actor.character for name, actor in edge.stage.actors.items() if name not in other_names}

    def _end_start(self) -> None:
        """Marks the start as successful."""
        self._journal = StartJournal()
        self._update_journal("", is_starting=False)

    def _update_journal(self, current: str, *, is_starting: bool) -> None:
        self._journal.current, self._journal.is_starting = current, is_starting
        try:
            self._folder.write_journal(self._journal)
        except EnlivenError as error:
            log.warning("%s", error)


class _StageWriter:
    """Writes states and characters on its own thread."""

    def __init__(self, folder: StageFolder, written: StageState) -> None:
        self._folder, self._written = folder, written
        self._state, self._scanned_characters = written, dict[str, Character]()
        self._data: dict[str, bytes] = {}
        self._scan_entries: dict[str, tuple[Character, KeptCharacter]] = {}
        self._changed, self._ended = threading.Condition(), False
        self._has_failed = False
        self._thread = threading.Thread(target=self._run, name="kept stage", daemon=True)
        self._thread.start()

    def add_data(self, order: PutCharacter, data: bytes) -> None:
        """Queues the data of a character that was put on the stage."""
        with self._changed:
            self._data[order.digest.hex()] = data

    def set_state(self, state: StageState, scanned: dict[str, Character]) -> None:
        """Sets the newest state. The writer writes it if it differs from the written one."""
        with self._changed:
            self._state, self._scanned_characters = state, scanned
            self._changed.notify()

    def close(self) -> None:
        """Writes the last state, and ends the thread."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join(_CLOSE_TIMEOUT_S)

    def _run(self) -> None:
        written_state: StageState | None = self._state
        while True:
            with self._changed:
                while self._state is written_state and not self._ended:
                    self._changed.wait()
                state, scanned, has_ended = self._state, self._scanned_characters, self._ended
                data = dict(self._data)
            wait_s = _WRITE_INTERVAL_S
            try:
                self._write(state, scanned, data)
                self._has_failed, written_state = False, state
            except (EnlivenError, OSError) as error:
                if not self._has_failed:
                    log.warning("the stage could not be saved (%s). The edge will try again.", error)
                # None makes the writer write the same state again at the next attempt.
                self._has_failed, wait_s, written_state = True, _RETRY_INTERVAL_S, None
            if has_ended:
                return
            with self._changed:
                self._changed.wait_for(lambda: self._ended, wait_s)

    def _write(self, state: StageState, scanned: Mapping[str, Character], data: Mapping[str, bytes]) -> None:
        """Writes the data of characters, then the state that names them. Finally deletes unused data."""
        for digest, content in data.items():
            self._folder.write_character(digest, content)
            with self._changed:
                self._data.pop(digest, None)
        state = self._write_scanned_characters(state, scanned)
        if state == self._written:
            return
        self._folder.write(state)
        self._written = state
        self._folder.delete_characters_except({character.digest for character in state.characters})

    def _write_scanned_characters(self, state: StageState, scanned: Mapping[str, Character]) -> StageState:
        """Writes the data of scanned characters, and returns the state with their entries."""
        entries = {}
        for name, character in scanned.items():
            old_entry = self._scan_entries.get(name)
            if old_entry is None or old_entry[0] is not character:
                data = _scan_data(character)
                digest = hashlib.sha256(data).hexdigest()
                self._folder.write_character(digest, data)
                old_entry = character, KeptCharacter(name, digest, len(data))
            entries[name] = old_entry
        self._scan_entries = entries
        replace = msgspec.structs.replace
        characters = tuple(
            replace(
                scanned_entry,
                digest=entries[scanned_entry.id][1].digest,
                size=entries[scanned_entry.id][1].size,
            )
            if scanned_entry.id in entries
            else scanned_entry
            for scanned_entry in state.characters
        )
        return replace(state, characters=characters)


def _scan_data(character: Character) -> bytes:
    """Returns the data of a scanned character, as a client would send it."""
    # Import it here, because an edge without scans does not need it.
    from enliven.formats.project.one_character import character_bytes, project_of_mesh
    from enliven.meshes import Mesh

    vertices = np.asarray(character.vertices, np.float64)
    mesh = Mesh(vertices, character.faces, character.id, character.colours)
    return character_bytes(project_of_mesh(mesh, character.id), character.id)


def _make_kept_character(name: str, actor: Actor, order: PutCharacter | None) -> KeptCharacter:
    """Returns the entry of a character on the stage. ``order`` is None for one that no viewer has sent."""
    growth, exaggeration, aside = actor.growth, actor.exaggeration, float(actor.aside)
    if order is None:
        return KeptCharacter(name, growth=growth, exaggeration=exaggeration, aside=aside)
    digest = order.digest.hex()
    return KeptCharacter(name, digest, order.size, order.revision, order.fit, growth, exaggeration, aside)


def _order_from_kept(kept: KeptCharacter) -> PutCharacter:
    """Returns the request of the viewer that sent a character."""
    return PutCharacter(kept.id, kept.revision, bytes.fromhex(kept.digest), max(kept.size, 1), kept.fit)


def _restore_place(actor: Actor, kept: KeptCharacter) -> None:
    """Restores a character's waiting place, size and overshoot, if they were stored."""
    actor.aside = kept.aside
    try:
        if kept.growth != actor.growth:
            actor.resize(kept.growth)
        if kept.exaggeration != actor.exaggeration:
            actor.exaggerate(kept.exaggeration)
    except EnlivenError as error:
        log.warning("%s", error)
