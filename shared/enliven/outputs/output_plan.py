"""Checks the settings of live outputs, and opens the outputs that they describe."""

from __future__ import annotations

import dataclasses
import errno
import os
import re
import socket
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from enliven.doctor import need
from enliven.errors import InputError, ResourceError
from enliven.keys.key_files import is_loopback
from enliven.outputs.address import OutputAddress, Place, parse_address, resolve
from enliven.outputs.live_frame import PERFORMER
from enliven.outputs.output import LiveOutput
from enliven.outputs.registry import OUTPUTS, Protocol
from enliven.outputs.sender import Sender
from enliven.outputs.settings import LiveOutputSettings
from enliven.outputs.udp_sender import UdpSender
from enliven.outputs.warmup import sample_frame

_PERFORMER_NAME = re.compile(rf"{PERFORMER}[1-9]\d{{0,3}}")


@dataclass(frozen=True)
class OutputPlan:
    """An output with checked settings, which can be opened in this or another process.

    Attributes:
        address: the parsed address.
        settings: the settings of the output.
        folder: folder to which paths in the settings are relative.
        family, place: address family and socket address of the receiver, or of the server if the output
            listens. See :func:`enliven.outputs.address.resolve`.
    """

    address: OutputAddress
    settings: LiveOutputSettings
    folder: Path
    family: socket.AddressFamily
    place: Place

    @property
    def name(self) -> str:
        """The address as text, for messages."""
        return str(self.address)

    @property
    def protocol(self) -> Protocol:
        """The protocol of the address, from the registry."""
        return OUTPUTS[self.address.scheme]

    def convert(self) -> LiveOutput | None:
        """Returns a new object that converts frames to packets, or None for an output that listens.

        Raises:
            InputError: for a wrong mapping file.
        """
        return (
            None
            if self.protocol.open is None
            else self.protocol.open(self.address, self.settings, self.folder)
        )

    def open(self) -> Sender:
        """Opens the output. Its kernels are compiled or loaded from the cache.

        Raises:
            InputError: for a wrong mapping file.
            ResourceError: if a port is in use.
        """
        if self.protocol.listen is not None:
            return self.protocol.listen(self.name, str(self.place[0]), self.address.port)
        output, trial = self.convert(), self.convert()
        assert output is not None and trial is not None
        # Warm up a second converter, because a converter counts its time from its first frame.
        trial.encode_packets(sample_frame())
        return UdpSender(self.name, output, self.family, self.place)


def plan_outputs(
    settings: Mapping[str, LiveOutputSettings], folder: Path | None = None, *, insecure: bool = False
) -> list[OutputPlan]:
    """Checks the outputs in the settings and on the command line. For arguments and errors see
    :func:`opening.open_outputs`."""
    plans, taken_targets = list[OutputPlan](), dict[tuple[object, ...], str]()
    for name, wanted in settings.items():
        where = name if name.startswith("--out") else f"outputs.{name}"
        address = parse_address(wanted.to, {scheme: row.port for scheme, row in OUTPUTS.items()}, where)
        protocol = OUTPUTS[address.scheme]
        _check_source(address, protocol, where)
        _refuse_other_keys(wanted, address.scheme, protocol, where)
        family, place = resolve(address, where)
        key = (address.scheme, *place)
        if key in taken_targets:
            remedy = "Remove one of the two outputs, or choose another port for one."
            raise InputError(
                f"{address} is the same output as {taken_targets[key]}", where=where, remedy=remedy
            )
        taken_targets[key] = where
        need(protocol.library, protocol.extra, where, package="enliven")
        if protocol.listen is not None:
            _check_reach(str(place[0]), insecure or wanted.insecure, address, where)
            check_port(str(address), str(place[0]), address.port)
        plans.append(OutputPlan(address, wanted, folder or Path(), family, place))
    return plans


def check_port(name: str, host: str, port: int) -> None:
    """Checks that a server can listen on a port.

    Args:
        name: name of the output, for the error message.

    Raises:
        ResourceError: if the port cannot be opened.
    """
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as attempt:
        if sys.platform != "win32":  # On Windows this option would let two programs share a port.
            attempt.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            attempt.bind((host, port))
            attempt.listen(1)
        except OSError as error:
            reason = os.strerror(error.errno or errno.EADDRINUSE)
            remedy = "End the other program that uses this port, or choose another port: foxglove:HOST:PORT."
            problem = f"port {port} of {host} cannot be opened ({reason})"
            raise ResourceError(problem, where=name, remedy=remedy) from None


def _check_reach(host: str, insecure: bool, address: OutputAddress, where: str) -> None:
    """Raises InputError if other computers could read from this server, unless ``insecure`` is set."""
    if insecure or is_loopback(host):
        return
    remedy = (
        f"Write {address.scheme}:127.0.0.1, and connect from other computers through SSH: "
        f"ssh -L {address.port}:127.0.0.1:{address.port} USER@EDGE. To let everyone in the network watch, "
        "set insecure = true in the settings of this output, or start the edge with --insecure."
    )
    problem = (
        f"every computer that reaches {host} could watch the performers and the room, because "
        f"{address.scheme} has "
        "no keys"
    )
    raise InputError(problem, where=where, remedy=remedy)


def _check_source(address: OutputAddress, protocol: Protocol, where: str) -> None:
    """Raises InputError if the protocol cannot send the source in the address."""
    source = address.source
    if not source:
        return
    is_performer = _PERFORMER_NAME.fullmatch(source) is not None
    if protocol.sources == "none":
        remedy = f"Remove /{source} from the address. This protocol sends everything on the stage."
        raise InputError(
            f"{address.scheme} always sends everything, so no source can be chosen",
            where=where,
            remedy=remedy,
        )
    if source.startswith(PERFORMER) and not is_performer:
        remedy = f"Write {PERFORMER}1 for the first performer, {PERFORMER}2 for the second, and so on."
        raise InputError(f"{source!r} is not the name of a performer", where=where, remedy=remedy)
    if protocol.sources == "performers" and not is_performer:
        remedy = f"Write {PERFORMER}1 for the first performer, or remove /{source} from the address."
        raise InputError(
            f"{address.scheme} can send only performers, and {source!r} is not a performer",
            where=where,
            remedy=remedy,
        )


def _refuse_other_keys(wanted: LiveOutputSettings, scheme: str, protocol: Protocol, where: str) -> None:
    """Raises InputError if the settings contain a key that this protocol would ignore."""
    own_keys = {"to", *protocol.keys}
    for item in dataclasses.fields(wanted):
        if item.name not in own_keys and getattr(wanted, item.name) != item.default:
            remedy = f"Outputs with the protocol {scheme} have the keys {', '.join(sorted(own_keys))}."
            raise InputError(
                f"the key {item.name} does not apply to the protocol {scheme}", where=where, remedy=remedy
            )
