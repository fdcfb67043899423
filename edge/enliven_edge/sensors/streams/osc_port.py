"""A UDP port that receives OSC. It collects the messages of one frame from several packets."""

from __future__ import annotations

import logging
import time
from collections.abc import Hashable, Iterator

from pythonosc.osc_message import OscMessage, ParseError

from enliven.errors import InputError
from enliven.supervision.closeable import Closeable
from enliven_edge.sensors.streams.stream_sensor import Message
from enliven_edge.sensors.streams.udp_port import MAX_PACKET_BYTES, listen_udp

_QUIET_S = 0.004
"""Seconds without a packet after which a frame is complete. Senders send all packets of a frame without a
pause."""
_MAX_FRAME_S = 0.05
"""Maximum seconds for collecting one frame, for senders that never pause."""
_BUNDLE_START = b"#bundle\0"
"""The first bytes of a bundle."""
_BUNDLE_HEAD_BYTES = 16
"""Bytes of a bundle before its first element: the start marker and the time."""
_SIZE_BYTES = 4
"""Bytes of the size in front of each element of a bundle."""
_MAX_BUNDLE_DEPTH = 8
"""Maximum nesting depth of bundles. Senders of motion do not nest them."""


class _DropOscWarnings(logging.Filter):
    """Drops the log messages of python-osc. It logs each malformed packet, so a flood would fill the disk."""

    def filter(self, record: logging.LogRecord) -> bool:
        return "pythonosc" not in record.pathname


_OSC_WARNINGS = _DropOscWarnings()
"""The filter of the root logger, which python-osc uses. Adding it again has no effect."""


class OscPort(Closeable):
    """Receives OSC messages frame by frame.

    Args:
        host: the address to listen on. "0.0.0.0" also accepts other machines.
        port: the UDP port. 0 picks a free one.
        where: the name of the sensor, for error messages.

    Attributes:
        malformed: number of packets that were not OSC.

    Raises:
        InputError: for a number that is not a port.
        ResourceError: for a port in use, or an address that does not belong to this machine.
    """

    def __init__(self, host: str, port: int, where: str) -> None:
        self.malformed = 0
        logging.getLogger().addFilter(_OSC_WARNINGS)
        self._socket = listen_udp(host, port, where)
        self.port: int = self._socket.getsockname()[1]
        self._early: list[Message] = []

    def frame(self, timeout: float | None) -> list[Message]:
        """Returns the messages of one frame. A frame ends at a pause of the sender, or when a message
        repeats.

        Raises:
            TimeoutError: if nothing arrived in time.
        """
        messages, self._early = self._early, []
        names = {_name_of(message) for message in messages}
        if not messages:
            messages = list(self._receive(timeout))
            names = {_name_of(message) for message in messages}
        end = time.monotonic() + _MAX_FRAME_S
        while time.monotonic() < end:
            try:
                more_messages = list(self._receive(_QUIET_S))
            except TimeoutError:
                break
            if any(_name_of(message) in names for message in more_messages):
                self._early = more_messages
                break
            messages += more_messages
            names.update(map(_name_of, more_messages))
        return messages

    def close(self) -> None:
        """Closes the socket, so that another program can use the port."""
        self._socket.close()

    def _receive(self, timeout: float | None) -> Iterator[Message]:
        """Yields the messages of the next packet. A packet that is not OSC is only counted."""
        self._socket.settimeout(timeout)
        data = self._socket.recv(MAX_PACKET_BYTES)
        try:
            yield from unpack_osc(data)
        except InputError:
            self.malformed += 1


def unpack_osc(data: bytes) -> list[Message]:
    """Returns the messages of a packet, including those in bundles, in the order of the packet.

    Raises:
        InputError: for a packet that is not OSC.
    """
    try:
        messages = [OscMessage(part) for part in _split_bundle(data) if OscMessage.dgram_is_message(part)]
    except (ParseError, ValueError, IndexError):
        raise InputError("the packet is not OSC", where="an OSC port") from None
    return [(message.address, list(message.params)) for message in messages]


def _split_bundle(data: bytes, depth: int = 0) -> Iterator[bytes]:
    """Yields the bytes of each message of a packet.

    python-osc is not used for bundles. An element with a negative size makes it read the same bytes for ever,
    and a deeply nested bundle exceeds Python's limit of recursion.

    Raises:
        ValueError: for sizes that do not fit, and for deep nesting.
    """
    if not data.startswith(_BUNDLE_START):
        if depth == 0 and not data.startswith(b"/"):
            raise ValueError("neither a message nor a bundle")
        yield data
        return
    if depth >= _MAX_BUNDLE_DEPTH or len(data) < _BUNDLE_HEAD_BYTES:
        raise ValueError("a bundle that is too short, or nested too deep")
    offset = _BUNDLE_HEAD_BYTES
    while offset < len(data):
        size = int.from_bytes(data[offset : offset + _SIZE_BYTES], "big", signed=True)
        end = offset + _SIZE_BYTES + size
        if size < 0 or end > len(data):
            raise ValueError("an element that does not fit in its bundle")
        yield from _split_bundle(data[offset + _SIZE_BYTES : end], depth + 1)
        offset = end


def _name_of(message: Message) -> Hashable:
    """Returns the name of a message within a frame: its address, with its first argument if that is a
    string.
    """
    address, arguments = message
    return (address, arguments[0]) if arguments and isinstance(arguments[0], str) else address
