"""Character upload: receives and prepares characters that clients send, and puts them on the stage."""

from __future__ import annotations

import hashlib
import logging
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from enliven.errors import EnlivenError, InputError, find_plain_reason
from enliven.files import DAMAGE
from enliven.possession import Actor
from enliven.wire import (
    MAX_REVISION,
    MAX_UPLOAD_BYTES,
    Answer,
    Awaited,
    CharacterPart,
    Done,
    PutCharacter,
)
from enliven_edge.settings import EdgeSettings
from enliven_edge.stage.hold_memory import HoldStarts
from enliven_edge.stage.stage import Stage
from enliven_edge.stage.stage_capacity import Peer

log = logging.getLogger(__name__)

_MAX_UPLOADS_PER_VIEWER = 4
"""Maximum number of simultaneous uploads of one viewer. Their total size is at most ``MAX_UPLOAD_BYTES``."""
_MAX_UPLOADS = 12
"""Maximum number of simultaneous uploads of all viewers."""
_MAX_BYTES = 2 * MAX_UPLOAD_BYTES
"""Maximum total bytes of all characters that are being received or prepared. It is twice the limit of one
viewer, so that one viewer cannot use up the whole limit.
"""
_TIMEOUT_S = 10.0
"""Seconds without a new part after which an upload is dropped."""
_MIN_BYTES_PER_SECOND = 32 * 1024
"""Minimum upload rate in bytes per second after the first ``_TIMEOUT_S`` seconds. Slow wireless networks are
faster."""
_MAX_REFUSALS = 32
"""Maximum number of remembered refusals, so that equal data is not prepared again."""
MAX_REVISION_JUMP = 64
"""Maximum difference between the newest revision and the next one. Clients increase it by one, and skip
revisions that were never answered."""

_Key = tuple[Peer | None, str, bytes]
"""Key of an upload: the viewer, and the id and the digest of the character."""


@dataclass
class _Upload:
    """A character that is being uploaded."""

    order: PutCharacter
    peer: Peer | None = None
    parts: list[bytes] = field(default_factory=list)
    received: int = 0
    started_at: float = field(default_factory=time.monotonic)
    last_part_at: float = field(default_factory=time.monotonic)

    def is_late(self, now: float) -> bool:
        """Returns True if the upload has timed out: no parts arrive, or they arrive too slowly."""
        expected_bytes = (now - self.started_at - _TIMEOUT_S) * _MIN_BYTES_PER_SECOND
        return now - self.last_part_at >= _TIMEOUT_S or self.received < expected_bytes

    def eviction_key(self, now: float) -> tuple[float, float]:
        """Returns a sort key: the slowest uploads first, and the oldest first among equally slow ones."""
        return self.received / max(now - self.started_at, 0.1), self.last_part_at


class _Preparation(threading.Thread):
    """A thread that creates the actor of a character.

    Frames continue in the meantime, because the solvers' kernels release the interpreter lock.
    """

    def __init__(self, upload: _Upload, stage: Stage, settings: EdgeSettings) -> None:
        super().__init__(name="preparation", daemon=True)
        self.order, self.peer, self.data = upload.order, upload.peer, b"".join(upload.parts)
        self._stage, self._settings = stage, settings
        self.actor: Actor | None = None
        self.refused: InputError | None = None
        self.carried: HoldStarts | None = None

    def run(self) -> None:
        # Import it here, because an edge without uploads does not need it.
        from enliven_edge.uploaded_actor import create_uploaded_actor

        where, remedy = f"character {self.order.id!r}", "Send the character again."
        try:
            if hashlib.sha256(self.data).digest() != self.order.digest:
                raise InputError("the data was changed during the transfer", where=where, remedy=remedy)
            previous = self._stage.actors.get(self.order.id)
            actor = create_uploaded_actor(self.data, self.order, self._settings, previous)
            self.carried = self._stage.carry_over(actor)
            self.actor = actor
        except EnlivenError as error:
            self.refused = InputError(error.what, where=error.where or where, remedy=error.remedy)
        except (*DAMAGE, RuntimeError) as error:
            problem = f"the character is damaged: {find_plain_reason(error)}"
            self.refused = InputError(
                problem, where=where, remedy="Open the character in enliven studio, and correct it."
            )


class CharacterUploads:
    """Receives and prepares the characters that clients send, and puts them on the stage.

    A replaced character stays until its successor is ready. If a viewer announces characters but does not
    send them, they are dropped when other viewers need the room.

    Args:
        settings: the edge's settings, for the actors.

    Attributes:
        last_revision: returns the newest revision of a character that viewers have. For a character that is
            not on the stage, returns the highest revision of the removed characters.
        on_shown: called with the request and the data of each character that was put on the stage. If None,
            the data is dropped.
    """

    def __init__(self, stage: Stage, settings: EdgeSettings | None = None) -> None:
        self.last_revision: Callable[[str], int] = lambda name: 0
        self.on_shown: Callable[[PutCharacter, bytes], None] | None = None
        self._stage, self._settings = stage, settings or EdgeSettings()
        self._waiting: dict[_Key, _Upload] = {}
        self._complete: deque[_Upload] = deque()
        self._preparing: _Preparation | None = None
        self._on_stage: dict[str, PutCharacter] = {}
        self._refused: dict[PutCharacter, InputError] = {}
        self._last_served: Peer | None = None
        stage.places.watch(self._iterate_uploads)

    @property
    def revisions(self) -> dict[str, int]:
        """Returns the revisions of the characters that clients put on the stage, by id."""
        return {name: order.revision for name, order in self._on_stage.items()}

    @property
    def orders(self) -> dict[str, PutCharacter]:
        """Returns the requests of clients that put characters on the stage, by character id."""
        return {name: order for name, order in self._on_stage.items() if name in self._stage.actors}

    def restore(self, order: PutCharacter, actor: Actor) -> None:
        """Puts a character on the stage that a client had sent before a restart of the edge."""
        self._stage.place_actor(actor)
        self._on_stage[order.id] = order

    def announce(self, order: PutCharacter, peer: Peer | None = None) -> Answer:
        """Handles the announcement of a character, or a question about its progress.

        Args:
            peer: the viewer that asks, or None for the edge itself.

        Raises:
            InputError: if the character was refused, if its revision is not newer, or if the stage is full.
        """
        current = self._on_stage.get(order.id)
        if current is not None and (current.digest, current.fit) == (order.digest, order.fit):
            return Done()
        if order in self._refused:
            raise self._refused[order]
        where = f"character {order.id!r}"
        self._check_revision(order, current, where)
        if any(order == upload.order for upload in self._complete) or (
            self._preparing is not None and self._preparing.order == order
        ):
            return Awaited(order.size)
        return Awaited(self._find_or_add(order, peer, where).received)

    def add_part(self, part: CharacterPart, peer: Peer | None = None) -> Answer:
        """Adds the next part of an announced character.

        Raises:
            InputError: for an unexpected part.
        """
        key = peer, part.id, part.digest
        upload = self._waiting.get(key)
        if upload is None or part.offset != upload.received:
            expected = (
                "no upload was announced"
                if upload is None
                else f"the next part starts at byte {upload.received}"
            )
            raise InputError(
                f"the part at byte {part.offset} was not expected: {expected}",
                where=f"character {part.id!r}",
                remedy="Send PutCharacter to get the progress of the upload.",
            )
        upload.received += len(part.data)
        upload.last_part_at = time.monotonic()
        if upload.received > upload.order.size:
            del self._waiting[key]
            problem = f"more than the announced {upload.order.size} bytes were received"
            raise InputError(
                problem,
                where=f"character {part.id!r}",
                remedy="Announce the character again with PutCharacter.",
            )
        upload.parts.append(part.data)
        if upload.received == upload.order.size:
            self._complete = deque(older for older in self._complete if not _replaces(upload, older))
            self._complete.append(self._waiting.pop(key))
        return Awaited(upload.received)

    def poll(self) -> None:
        """Puts prepared characters on the stage, and starts preparing uploaded ones. Call it once per
        frame."""
        self._on_stage = {name: order for name, order in self._on_stage.items() if name in self._stage.actors}
        self._drop_slow_uploads()
        preparation = self._preparing
        if preparation is not None and not preparation.is_alive():
            self._preparing = None
            self._finish_preparation(preparation)
        if self._preparing is None and self._complete:
            self._preparing = _Preparation(self._dequeue_upload(), self._stage, self._settings)
            self._last_served = self._preparing.peer
            self._preparing.start()

    def _check_revision(self, order: PutCharacter, current: PutCharacter | None, where: str) -> None:
        """Raises InputError for a revision that is not newer than the one on the stage, or skips too many."""
        newest = self.last_revision(order.id) or (0 if current is None else current.revision)
        remedy = f"Send revision {newest + 1}."
        if current is not None and order.revision <= newest:
            raise InputError(
                f"revision {newest} of the character is already on the stage", where=where, remedy=remedy
            )
        if order.revision > min(newest + MAX_REVISION_JUMP, MAX_REVISION):
            problem = f"revision {order.revision} is too far above the newest revision, {newest}"
            raise InputError(problem, where=where, remedy=remedy)

    def _dequeue_upload(self) -> _Upload:
        """Returns the next character to prepare. Viewers take turns, so that one viewer with many characters
        cannot block others.
        """
        others = (candidate for candidate in self._complete if candidate.peer is not self._last_served)
        upload = next(others, self._complete[0])
        self._complete = deque(candidate for candidate in self._complete if candidate is not upload)
        return upload

    def _iterate_uploads(self) -> Iterator[tuple[str, Peer | None]]:
        """Yields the id of each character that is being uploaded, and the viewer that sends it."""
        for upload in [*self._waiting.values(), *self._complete]:
            yield upload.order.id, upload.peer
        if self._preparing is not None:
            yield self._preparing.order.id, self._preparing.peer

    def _finish_preparation(self, preparation: _Preparation) -> None:
        """Puts a prepared character on the stage, or remembers why it was refused."""
        order, current = preparation.order, self._on_stage.get(preparation.order.id)
        if preparation.actor is None:
            problem = f"the preparation of {order.id!r} ended early"
            self._refused[order] = preparation.refused or InputError(
                problem, where="stage", remedy="The log of the edge contains the reason."
            )
            log.warning("%s", self._refused[order])
            for oldest in list(self._refused)[:-_MAX_REFUSALS]:
                del self._refused[oldest]
        elif current is None or current.revision < order.revision:
            self._stage.place_actor(preparation.actor, preparation.carried, preparation.peer)
            self._on_stage[order.id] = order
            if self.on_shown is not None:
                self.on_shown(order, preparation.data)
            log.info("%s is on the stage, revision %d", order.id, order.revision)

    def _find_or_add(self, order: PutCharacter, peer: Peer | None, where: str) -> _Upload:
        """Returns the upload of a character. A new upload replaces an earlier one of the same viewer and
        id."""
        key = peer, order.id, order.digest
        self._drop_slow_uploads()
        pending = self._waiting.get(key) or self._resume(order, peer)
        if pending is not None and pending.order == order:
            return pending
        upload = _Upload(order, peer)
        self._waiting = {key: other for key, other in self._waiting.items() if not _replaces(upload, other)}
        self._stage.places.check(order.id, peer)
        self._make_room(upload, where)
        self._waiting[key] = upload
        return upload

    def _drop_slow_uploads(self) -> None:
        """Drops uploads that stopped or are too slow."""
        now = time.monotonic()
        self._waiting = {key: upload for key, upload in self._waiting.items() if not upload.is_late(now)}

    def _resume(self, order: PutCharacter, peer: Peer | None) -> _Upload | None:
        """Returns the upload that a viewer had started before it reconnected, or None."""
        for key, upload in self._waiting.items():
            if upload.order == order and upload.peer is not None and not upload.peer.is_open:
                self._waiting[peer, order.id, order.digest] = self._waiting.pop(key)
                upload.peer = peer
                return upload
        return None

    def _make_room(self, new_upload: _Upload, where: str) -> None:
        """Drops the slowest uploads of viewers with more uploads than this one, until the new one fits.

        Raises:
            InputError: if this viewer has too many uploads, or all others have fewer.
        """
        order, now = new_upload.order, time.monotonic()
        while True:
            all_uploads = [*self._waiting.values(), *self._complete]
            viewer_uploads = [upload for upload in all_uploads if upload.peer is new_upload.peer]
            free_bytes = MAX_UPLOAD_BYTES - sum(upload.order.size for upload in viewer_uploads)
            remedy = "Send the character again in a moment."
            if len(viewer_uploads) >= _MAX_UPLOADS_PER_VIEWER or order.size > free_bytes:
                raise InputError("too many characters are being transferred", where=where, remedy=remedy)
            free_bytes = _MAX_BYTES - sum(upload.order.size for upload in all_uploads)
            if len(all_uploads) < _MAX_UPLOADS and order.size <= free_bytes:
                return
            counts = Counter(upload.peer for upload in all_uploads)
            other_uploads = [entry for entry in self._waiting.items() if entry[1].peer is not new_upload.peer]
            if not other_uploads:
                raise InputError("too many characters are being transferred", where=where, remedy=remedy)
            slowest = min(
                other_uploads, key=lambda entry: (-counts[entry[1].peer], *entry[1].eviction_key(now))
            )
            del self._waiting[slowest[0]]


def _replaces(newer: _Upload, older: _Upload) -> bool:
    """Returns True if an upload replaces an older one of the same viewer and character."""
    return newer is not older and newer.peer is older.peer and newer.order.id == older.order.id
