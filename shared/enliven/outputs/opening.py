"""Opens live outputs from their settings, and hands frames to their thread."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import logging
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from enliven.doctor import need
from enliven.errors import InputError
from enliven.health import HealthState
from enliven.keys.key_files import is_loopback
from enliven.outputs.address import OutputAddress, parse_address, resolve
from enliven.outputs.frame_thread import FrameThread
from enliven.outputs.live_frame import PERFORMER, CharacterInfo, LiveFrame
from enliven.outputs.registry import OUTPUTS, Protocol
from enliven.outputs.sender import Sender
from enliven.outputs.settings import LiveOutputSettings
from enliven.outputs.udp_sender import UdpSender
from enliven.outputs.warmup import sample_frame
from enliven.supervision.closeable import Closeable

log = logging.getLogger(__name__)

_PERFORMER_NAME = re.compile(rf"{PERFORMER}[1-9]\d{{0,3}}")


class OutputSet(Closeable):
    """The open outputs of a program. Its methods never wait for a receiver.

    Args:
        senders: the outputs. It closes them.
    """

    def __init__(self, senders: Sequence[Sender] = ()) -> None:
        self.senders = list(senders)
        self._thread = FrameThread(self.senders) if senders else None

    def check(self, characters: Mapping[str, CharacterInfo]) -> None:
        """Checks that the outputs can send the characters that their addresses name.

        Raises:
            InputError: if one cannot.
        """
        for sender in self.senders:
            sender.check(characters)

    def put(self, frame: LiveFrame) -> None:
        """Hands a frame to every output. It returns at once."""
        if self._thread is not None:
            self._thread.put(frame)

    def put_health(self, states: Sequence[HealthState]) -> None:
        """Hands health states to every output. It returns at once."""
        for sender in self.senders:
            sender.put_health(states)

    @property
    def troubles(self) -> dict[str, str]:
        """Why outputs lose packets now, by the name of each failing output."""
        return {sender.name: sender.trouble for sender in self.senders if sender.trouble}

    def close(self) -> None:
        """Sends the frame that waits, ends the thread and closes the outputs."""
        if self._thread is not None:
            self._thread.close()
            log.debug("outputs: %d frames skipped", self._thread.skipped)
        for sender in self.senders:
            sender.close()
            log.debug("output %s: %d packets sent, %d lost", sender.name, sender.sent, sender.errors)


def open_outputs(
    settings: Mapping[str, LiveOutputSettings], folder: Path | None = None, *, insecure: bool = False
) -> OutputSet:
    """Opens the outputs of the settings and the command line, and starts their thread.

    Args:
        settings: by name.
        folder: of the settings file, to which paths in it are relative. None: the current folder.
        insecure: True if the edge itself uses no keys. Outputs that listen may then listen everywhere, too.

    Raises:
        InputError: for a bad address, a host that is not found, an output that occurs twice, a key of
            another protocol, or an output that other computers can read without ``insecure``.
        ResourceError: if a library is not installed, or a port is in use.
    """
    openers, taken = list[Callable[[], Sender]](), dict[tuple[object, ...], str]()
    for name, wanted in settings.items():
        where = name if name.startswith("--out") else f"outputs.{name}"
        address = parse_address(wanted.to, {scheme: row.port for scheme, row in OUTPUTS.items()}, where)
        protocol = OUTPUTS[address.scheme]
        _check_source(address, protocol, where)
        _refuse_other_keys(wanted, address.scheme, protocol, where)
        family, place = resolve(address, where)
        key = (address.scheme, *place)
        if key in taken:
            remedy = "Remove one of them, or give it another port."
            raise InputError(f"{address} is the same output as {taken[key]}", where=where, remedy=remedy)
        taken[key] = where
        need(protocol.library, protocol.extra, where, package="enliven")
        if protocol.listen is not None:
            host = str(place[0])
            _check_reach(host, insecure or wanted.insecure, address, where)
            openers.append(functools.partial(protocol.listen, str(address), host, address.port))
        elif protocol.open is not None:
            output = protocol.open(address, wanted, folder or Path())
            # Another output of the same kind, because one that has sent a frame counts its time from there.
            protocol.open(address, wanted, folder or Path()).packets(sample_frame())
            openers.append(functools.partial(UdpSender, str(address), output, family, place))
    with contextlib.ExitStack() as stack:
        senders = [stack.enter_context(opener()) for opener in openers]
        stack.pop_all()
        return OutputSet(senders)


def _check_reach(host: str, insecure: bool, address: OutputAddress, where: str) -> None:
    """Raises InputError for a server that other computers can read, unless ``insecure`` is set."""
    if insecure or is_loopback(host):
        return
    remedy = (
        f"Write {address.scheme}:127.0.0.1, and connect from other computers through SSH: "
        f"ssh -L {address.port}:127.0.0.1:{address.port} USER@EDGE. To let everyone in the network watch, "
        "set insecure = true in the settings of this output, or start the edge with --insecure."
    )
    problem = (
        f"everyone that reaches {host} could watch the performers and the room, because {address.scheme} has "
        "no keys"
    )
    raise InputError(problem, where=where, remedy=remedy)


def _check_source(address: OutputAddress, protocol: Protocol, where: str) -> None:
    """Raises InputError for a source that the protocol cannot send."""
    source = address.source
    if not source:
        return
    is_performer = _PERFORMER_NAME.fullmatch(source) is not None
    if protocol.sources == "none":
        remedy = f"Leave out /{source}: this protocol sends everything on the stage."
        raise InputError(f"{address.scheme} sends no single source", where=where, remedy=remedy)
    if source.startswith(PERFORMER) and not is_performer:
        remedy = f"Write {PERFORMER}1 for the first performer, {PERFORMER}2 for the second, and so on."
        raise InputError(f"{source!r} is not the name of a performer", where=where, remedy=remedy)
    if protocol.sources == "performers" and not is_performer:
        remedy = f"Write {PERFORMER}1 for the first performer, or leave it out."
        raise InputError(f"{address.scheme} sends performers, not {source!r}", where=where, remedy=remedy)


def _refuse_other_keys(wanted: LiveOutputSettings, scheme: str, protocol: Protocol, where: str) -> None:
    """Raises InputError for a key that this protocol would ignore."""
    own = {"to", *protocol.keys}
    for item in dataclasses.fields(wanted):
        if item.name not in own and getattr(wanted, item.name) != item.default:
            remedy = f"An output of {scheme} has the keys {', '.join(sorted(own))}."
            raise InputError(f"{item.name} is not a key of {scheme}", where=where, remedy=remedy)
