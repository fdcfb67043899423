"""The address of a live output: SCHEME:HOST[:PORT][/SOURCE]."""

from __future__ import annotations

import difflib
import re
import socket
from collections.abc import Mapping
from dataclasses import dataclass

from enliven.errors import InputError

FORM = "SCHEME:HOST[:PORT][/SOURCE], for example vmc:127.0.0.1 or vmc:192.168.1.20:39539/performer-1"
"""The syntax of an address, for error messages."""
Place = tuple[str, int] | tuple[str, int, int, int] | tuple[int, bytes]
"""A socket address of IPv4 or IPv6, as the system's resolver returns it."""
MAX_PORT = 65535
"""Largest port number."""
_ADDRESS = re.compile(
    r"(?P<scheme>[^:/\[\]]*):(?P<host>\[[^\]]*\]|[^:/]*)(?::(?P<port>[^/]*))?(?:/(?P<source>.*))?"
)


@dataclass(frozen=True)
class OutputAddress:
    """A parsed address of a live output.

    Attributes:
        scheme: the protocol, a key of ``registry.OUTPUTS``.
        host: name or IP address of the receiver, or this computer's address that the output listens on.
        port: UDP or TCP port of the receiver, or the port that the output listens on.
        source: id of a character or ``performer-N``. If empty, the protocol's default is used.
    """

    scheme: str
    host: str
    port: int
    source: str = ""

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}:{host}:{self.port}" + (f"/{self.source}" if self.source else "")


def parse_address(text: str, default_ports: Mapping[str, int], where: str) -> OutputAddress:
    """Parses the address of an output.

    Args:
        default_ports: the default port of each known scheme.
        where: name of the option or setting, for error messages.

    Raises:
        InputError: if the syntax, the scheme or the port is invalid.
    """
    match = _ADDRESS.fullmatch(text.strip())
    if match is None or not match["host"].strip("[]"):
        raise InputError(
            f"{text!r} is not the address of an output", where=where, remedy=f"Use the form {FORM}."
        )
    scheme, port = match["scheme"].lower(), match["port"]
    if scheme not in default_ports:
        near = difflib.get_close_matches(scheme, default_ports, n=1)
        guess = f"Did you mean {near[0]}? " if near else ""
        schemes = ", ".join(default_ports)
        problem = f"the output protocol {match['scheme']!r} is unknown"
        raise InputError(problem, where=where, remedy=f"{guess}Known protocols: {schemes}.")
    if port is not None and not (port.isascii() and port.isdecimal() and 1 <= int(port[:6]) <= MAX_PORT):
        remedy = f"Write a number from 1 to {MAX_PORT}, or leave the port out to use {default_ports[scheme]}."
        raise InputError(f"{port!r} is not a valid port", where=where, remedy=remedy)
    number = default_ports[scheme] if port is None else int(port)
    return OutputAddress(scheme, match["host"].strip("[]"), number, match["source"] or "")


def resolve(address: OutputAddress, where: str) -> tuple[socket.AddressFamily, Place]:
    """Returns the address family and the socket address of a receiver.

    Raises:
        InputError: if the host name cannot be resolved.
    """
    try:
        rows = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as error:
        why = getattr(error, "strerror", None) or "the name is not valid"
        remedy = "Check the spelling and the network, or use the IP address of the computer."
        raise InputError(
            f"the host {address.host!r} was not found ({why})", where=where, remedy=remedy
        ) from None
    # Prefer IPv4, because most receivers listen on IPv4 only, also for "localhost".
    family, _, _, _, place = min(rows, key=lambda row: row[0] != socket.AF_INET)
    return family, place
