"""The announcement of an edge on the local network as a DNS-SD text record. Received records are checked."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass

from enliven import __version__
from enliven.errors import InputError
from enliven.logs import escape_text
from enliven.wire import VERSION

SERVICE_TYPE = "_enliven._tcp.local."
"""The DNS-SD type of edges and relays."""
_MAX_NAME_LENGTH = 64
"""Maximum length of a displayed name in characters, as in the heartbeat."""
_MAX_INSTANCE_BYTES = 60
"""Maximum size of a service's name in bytes. DNS allows 63, but "-2" is appended if another edge has the same
name."""
_MAX_CHARACTERS = 10_000
"""Maximum number of characters on the stage that an announcement may contain. An edge usually has up to
16."""


@dataclass(frozen=True)
class Announcement:
    """The announcement of an edge or a relay. It contains no secret, because everyone on the network can read
    it.

    Attributes:
        name: name of the edge or relay.
        pose_port: port of the streams.
        control_port: port of the requests.
        has_keys: True if only paired viewers can connect.
        characters: number of characters on the stage.
        relay_of: the address of the edge that sends the messages which a relay forwards. Empty for an edge.
        wire_version: version of the network protocol.
        version: version of enliven.
    """

    name: str
    pose_port: int
    control_port: int
    has_keys: bool = False
    characters: int = 0
    relay_of: str = ""
    wire_version: int = VERSION
    version: str = __version__

    @property
    def instance(self) -> str:
        """The name of the service. It is the same at each start, so that lists stay stable."""
        printable = "".join(c if c.isprintable() and c != "." else "-" for c in self.name).strip() or "edge"
        return printable.encode()[:_MAX_INSTANCE_BYTES].decode(errors="ignore")

    @property
    def problem(self) -> str:
        """The reason why this release cannot connect to the announced edge. Empty if it can."""
        if self.wire_version == VERSION:
            return ""
        return (
            f"uses version {self.wire_version} of the network protocol, but this program uses version "
            f"{VERSION}"
        )


def pack_announcement(announcement: Announcement) -> dict[str, str]:
    """Returns the text record of an announcement. The pose port is not part of it, because DNS-SD has a field
    for the port.
    """
    return {
        "name": announcement.name[:_MAX_NAME_LENGTH],
        "control": str(announcement.control_port),
        "keys": str(int(announcement.has_keys)),
        "characters": str(announcement.characters),
        "relay": announcement.relay_of[:_MAX_NAME_LENGTH],
        "wire": str(announcement.wire_version),
        "version": announcement.version,
    }


def parse_announcement(port: int | None, properties: Mapping[bytes, bytes | None]) -> Announcement:
    """Parses a text record from the network. Names in the announcement are escaped for display.

    Raises:
        InputError: if the record is not from an edge.
    """
    name = _clean_text(properties, "name")
    if not name.strip():
        raise InputError("an edge was announced without a name", where="network")
    return Announcement(
        name,
        _number_in_range("port", str(port), 1, 65535),
        _number_in_range("control", _clean_text(properties, "control"), 1, 65535),
        _clean_text(properties, "keys") != "0",
        _number_in_range("characters", _clean_text(properties, "characters"), 0, _MAX_CHARACTERS),
        _clean_text(properties, "relay"),
        _number_in_range("wire", _clean_text(properties, "wire"), 0, 255),
        _clean_text(properties, "version"),
    )


def find_missing_discovery_reason() -> str:
    """Returns the reason why edges cannot be found or announced, with the remedy. Returns an empty string if
    they can."""
    if importlib.util.find_spec("zeroconf") is not None:
        return ""
    return "the library 'zeroconf' is not installed. Install it: pip install zeroconf"


def _clean_text(properties: Mapping[bytes, bytes | None], key: str) -> str:
    """Returns an escaped and shortened value of the record, or an empty string if it is missing."""
    value = properties.get(key.encode()) or b""
    return escape_text(value[: 4 * _MAX_NAME_LENGTH].decode(errors="replace")[:_MAX_NAME_LENGTH])


def _number_in_range(key: str, text: str, low: int, high: int) -> int:
    """Parses a number and checks its range.

    Raises:
        InputError: if the text is not a number in the range.
    """
    if text.isascii() and text.isdecimal() and len(text) < 8 and low <= int(text) <= high:
        return int(text)
    raise InputError(f"an edge was announced with an invalid value of {key!r}: {text!r:.40}", where="network")
