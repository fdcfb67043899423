"""All live outputs of an edge: opened from its settings, and fed with the result of every frame."""

from __future__ import annotations

import dataclasses
import logging
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from enliven.errors import InputError
from enliven.health import HealthKind, HealthState
from enliven_edge.closeable import Closeable
from enliven_edge.extras import need
from enliven_edge.outputs.address import OutputAddress, parse_address, resolve
from enliven_edge.outputs.humanoid_map import humanoid_map
from enliven_edge.outputs.live_frame import PERFORMER, CharacterInfo, LiveEvent, LiveFrame, PerformerSlots
from enliven_edge.outputs.output import LiveOutput
from enliven_edge.outputs.registry import OUTPUTS, Protocol
from enliven_edge.outputs.sender import Sender
from enliven_edge.outputs.settings import LiveOutputSettings
from enliven_edge.stage import Stage, Tick
from enliven_edge.tracking.health import HEALTH_MESSAGES

log = logging.getLogger(__name__)

_PERFORMER_NAME = re.compile(rf"{PERFORMER}[1-9]\d{{0,3}}")


class LiveOutputs(Closeable):
    """Hands every frame of the edge to the thread of each output. It never waits.

    Args:
        outputs: with the sender of each.
    """

    def __init__(self, outputs: Sequence[tuple[LiveOutput, Sender]] = ()) -> None:
        self._outputs = list(outputs)
        self._numbers = PerformerSlots()
        self._characters: dict[str, CharacterInfo] = {}
        self._since_ns: dict[str, int] = {}
        self._time_ns = 0

    @property
    def senders(self) -> list[Sender]:
        """The sender of each output."""
        return [sender for _, sender in self._outputs]

    def check(self, stage: Stage) -> None:
        """Checks that the outputs can send the characters that their addresses name.

        Raises:
            InputError: if one cannot.
        """
        self._update_characters(stage)
        for output, _ in self._outputs:
            output.check(self._characters)

    def publish(self, tick: Tick, stage: Stage) -> None:
        """Hands the result of a frame to every output. It returns at once."""
        if not self._outputs:
            return
        self._time_ns = tick.time_ns
        self._update_characters(stage)
        numbered, events = self._numbers.number(tick.bodies, tick.time_ns)
        events += self._hold_events(tick)
        held = frozenset(name for name, actor in stage.actors.items() if actor.holds)
        characters = dict(self._characters)
        frame = LiveFrame(tick.time_ns, numbered, tick.poses, characters, held, tick.props, events)
        for _, sender in self._outputs:
            sender.put(frame)

    @property
    def health_states(self) -> list[HealthState]:
        """The outputs that lose packets now."""
        states = []
        message = HEALTH_MESSAGES[HealthKind.OUTPUT_FAILS]
        for _, sender in self._outputs:
            reason = sender.trouble
            if not reason:
                self._since_ns.pop(sender.name, None)
                continue
            since = self._since_ns.setdefault(sender.name, self._time_ns)
            problem = message.what.format(output=sender.name, why=reason)
            states.append(
                HealthState(HealthKind.OUTPUT_FAILS, message.severity, since, problem, message.mend)
            )
        return states

    def close(self) -> None:
        """Ends all threads and closes the sockets."""
        for _, sender in self._outputs:
            sender.close()
            log.debug(
                "output %s: %d packets sent, %d lost, %d frames skipped",
                *(sender.name, sender.sent, sender.errors, sender.skipped),
            )

    def _update_characters(self, stage: Stage) -> None:
        """Analyses the characters that are new on the stage, or changed."""
        for name, actor in list(stage.actors.items()):
            info = self._characters.get(name)
            if info is None or info.character is not actor.character:
                skeleton = actor.skeleton
                humanoid = None if skeleton is None else humanoid_map(skeleton)
                self._characters[name] = CharacterInfo(actor.character, humanoid)
        for name in self._characters.keys() - stage.actors.keys():
            del self._characters[name]

    def _hold_events(self, tick: Tick) -> list[LiveEvent]:
        """Returns the possessions and releases since the previous frame."""
        events = []
        for hold in tick.holds:
            kind = "release" if hold.mode in ("release", "remove") else "possess"
            performer = self._numbers.of(hold.body) if hold.body >= 0 else 0
            events.append(LiveEvent(kind, performer, hold.character))
        return events


def open_outputs(settings: Mapping[str, LiveOutputSettings], folder: Path | None = None) -> LiveOutputs:
    """Opens the outputs of the settings and the command line, and starts their threads.

    Args:
        settings: by name.
        folder: of the settings file, to which paths in it are relative. None: the current folder.

    Raises:
        InputError: for a bad address, a host that is not found, an output that occurs twice, or a key of
            another protocol.
        ResourceError: if a library is not installed.
    """
    ready, taken = [], dict[tuple[object, ...], str]()
    for name, wanted in settings.items():
        where = name if name.startswith("--out") else f"outputs.{name}"
        address = parse_address(wanted.to, {scheme: row.port for scheme, row in OUTPUTS.items()}, where)
        protocol = OUTPUTS[address.scheme]
        _check_source(address, protocol, where)
        _refuse_other_keys(wanted, address.scheme, protocol, where)
        family, place = resolve(address, where)
        key = (address.scheme, *place)
        if key in taken:
            mend = "Remove one of them, or give it another port."
            raise InputError(f"{address} is the same output as {taken[key]}", where=where, mend=mend)
        taken[key] = where
        need(protocol.library, "outputs", where)
        ready.append((address, protocol.open(address, wanted, folder or Path()), family, place))
    return LiveOutputs(
        [(output, Sender(str(to), output, family, place)) for to, output, family, place in ready]
    )


def _check_source(address: OutputAddress, protocol: Protocol, where: str) -> None:
    """Raises InputError for a source that the protocol cannot send."""
    source = address.source
    if not source:
        return
    is_performer = _PERFORMER_NAME.fullmatch(source) is not None
    if protocol.sources == "none":
        mend = f"Leave out /{source}: this protocol sends everything on the stage."
        raise InputError(f"{address.scheme} sends no single source", where=where, mend=mend)
    if source.startswith(PERFORMER) and not is_performer:
        mend = f"Write {PERFORMER}1 for the first performer, {PERFORMER}2 for the second, and so on."
        raise InputError(f"{source!r} is not the name of a performer", where=where, mend=mend)
    if protocol.sources == "performers" and not is_performer:
        mend = f"Write {PERFORMER}1 for the first performer, or leave it out."
        raise InputError(f"{address.scheme} sends performers, not {source!r}", where=where, mend=mend)


def _refuse_other_keys(wanted: LiveOutputSettings, scheme: str, protocol: Protocol, where: str) -> None:
    """Raises InputError for a key that this protocol would ignore."""
    own = {"to", *protocol.keys}
    for item in dataclasses.fields(wanted):
        if item.name not in own and getattr(wanted, item.name) != item.default:
            mend = f"An output of {scheme} has the keys {', '.join(sorted(own))}."
            raise InputError(f"{item.name} is not a key of {scheme}", where=where, mend=mend)
