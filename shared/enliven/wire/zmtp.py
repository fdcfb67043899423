"""The listening side of ZMTP 3.1 (the ZeroMQ protocol), with or without encryption. It converts received
bytes to messages and answers, and does no I/O.

Viewers use libzmq, but the listener does not. libzmq 4.3.5 aborts the program (``!_io_error`` in
stream_engine_base.cpp) if a peer sends PINGs within a flood of messages and then resets the connection.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from enliven.keys.curve import CurveChannel, CurveServer

GREETING = b"\xff" + bytes(8) + b"\x7f" + b"\x03\x01" + b"NULL".ljust(20, b"\0") + bytes(32)
"""The first 64 bytes that each side sends: signature, version 3.1, no encryption."""
CURVE_GREETING = GREETING[:12] + b"CURVE".ljust(20, b"\0") + b"\1" + bytes(31)
"""The first 64 bytes of a server with keys: signature, version 3.1, CURVE, as server."""
_VERSION_BYTES = 12
"""Size in bytes of a greeting up to its version. A peer waits for this part before it sends the rest of its
greeting."""
_MAX_HANDSHAKE_BYTES = 1024
"""Maximum size in bytes of a command of the CURVE handshake: 300 bytes plus the properties of the peer's
socket."""
_MIN_SEALED_BYTES = 33
"""Number of bytes that CURVE encryption adds to a message."""

_MORE_FLAG = 1
"""Flag of a frame that is followed by another frame of the same message."""
_LONG_FLAG = 2
"""Flag of a frame with a length of 8 bytes instead of 1."""
_COMMAND_FLAG = 4
"""Flag of a frame that contains a protocol command instead of a message."""
_CURVE_COMMAND_FLAG = 2
"""Flag inside an encrypted message that contains a protocol command."""
_MAX_PARTS = 8
"""Maximum number of parts of one message. A viewer sends one part, and libzmq's REQ sockets send two
parts."""
_MAX_CONTEXT_BYTES = 16
"""Maximum size in bytes of the context of a PING, which is sent back. The protocol defines this limit."""
_TTL_BYTES = 2
"""Size in bytes of a PING's time to live, which precedes its context."""


class ZmtpError(Exception):
    """Raised for bytes that are not valid ZMTP or longer than allowed. The connection must be closed."""


def make_frame(data: bytes, flags: int = 0) -> bytes:
    """Returns the bytes of one frame: flags, length and data."""
    return frame_header(len(data), flags) + data


def frame_header(length: int, flags: int = 0) -> bytes:
    """Returns the header of a frame with ``length`` bytes of data. With it, long data can be sent without a
    copy."""
    return bytes([flags, length]) if length < 256 else struct.pack(">BQ", flags | _LONG_FLAG, length)


class ZmtpSession:
    """The protocol state of one connection. Call ``feed``, then ``read_message`` until it returns None.

    Args:
        kind: kind of the listening socket. "ROUTER" accepts DEALER and REQ peers, and "PUB" accepts SUB
            peers.
        max_frame_bytes: maximum size of an accepted frame in bytes.
        curve: the keys of the listener, and the peers that it accepts. None for a listener without keys. A
            "ROUTER" with keys also accepts peers without keys, so that they can pair. These peers have no
            ``channel``.

    Attributes:
        is_ready: True after the handshake.
        channel: the encrypted channel of a peer with keys. None for a peer without keys.
        answers: bytes to send to the other side now. The caller empties it.
        missing: number of bytes missing until the end of the current frame, or of its header.
    """

    def __init__(
        self, kind: Literal["ROUTER", "PUB"], max_frame_bytes: int, curve: CurveServer | None = None
    ) -> None:
        self.is_ready, self.missing = False, 0
        self.channel: CurveChannel | None = None
        self._curve = curve
        # A peer without keys is recognised by its greeting. So a ROUTER with keys waits for the peer's
        # greeting before it sends the second part of its own greeting, which contains the mechanism.
        self._greeting = GREETING if curve is None else CURVE_GREETING
        early = len(GREETING) if curve is None or kind == "PUB" else _VERSION_BYTES
        self.answers, self._unsent_from = bytearray(self._greeting[:early]), early
        self._kind, self._most = kind, max_frame_bytes
        self._bytes, self._at, self._greeted = bytearray(), 0, False
        self._parts: list[bytes] = []

    def feed(self, data: bytes) -> None:
        """Adds received bytes."""
        del self._bytes[: self._at]
        self._at = 0
        self._bytes += data

    def read_message(self) -> list[bytes] | None:
        """Returns the parts of the next message. Returns an empty list for a command, and None if more bytes
        are needed.

        A subscription is one part: the byte 1 (subscribe) or 0 (unsubscribe), and the topic's prefix.

        Raises:
            ZmtpError: if the bytes are not valid ZMTP 3, or a message is too long.
        """
        if not self._greeted:
            return self._answer_greeting()
        frame = self._next_frame()
        if frame is None:
            return None
        flags, data = frame
        if self.channel is not None:
            if not self.is_ready:
                return self._handle_curve(self.channel, data)
            flags, data = self._open_sealed(self.channel, data)
        if flags & _COMMAND_FLAG:
            return self._handle_command(data)
        if not self.is_ready:
            raise ZmtpError("a message arrived before the end of the handshake")
        self._parts.append(data)
        if flags & _MORE_FLAG:
            if len(self._parts) >= _MAX_PARTS or sum(map(len, self._parts)) > self._most:
                raise ZmtpError(f"a message has more than {_MAX_PARTS} parts or {self._most} bytes")
            return []
        parts, self._parts = self._parts, []
        return parts

    def _answer_greeting(self) -> list[bytes] | None:
        """Checks the received part of the peer's greeting (64 bytes), and answers it."""
        greeting = self._bytes[: len(GREETING)]
        if (greeting and greeting[0] != 0xFF) or (
            len(greeting) > 10 and (not greeting[9] & 1 or greeting[10] < 3)
        ):
            raise ZmtpError("the peer does not use ZMTP 3")
        if len(greeting) < len(GREETING):
            return None
        without_keys = greeting[12:32] == GREETING[12:32]
        if without_keys and self._kind == "ROUTER":
            self._greeting = GREETING
        if greeting[12:32] != self._greeting[12:32]:
            raise ZmtpError("the peer uses another security mechanism")
        self.answers += self._greeting[self._unsent_from :]
        self._at, self._greeted = len(GREETING), True
        if self._curve is not None and not without_keys:
            from enliven.keys.curve import CurveChannel

            self.channel = CurveChannel(self._curve)
        else:
            self.answers += make_frame(b"\x05READY" + self._metadata, _COMMAND_FLAG)
        return []

    @property
    def _metadata(self) -> bytes:
        """Returns the metadata of this side of the connection, which contain the kind of its socket."""
        return b"\x0bSocket-Type" + struct.pack(">I", len(self._kind)) + self._kind.encode()

    def _handle_curve(self, channel: CurveChannel, data: bytes) -> list[bytes]:
        """Handles a command of the CURVE handshake."""
        from enliven.keys.curve import CurveError

        try:
            answer = channel.answer(data, self._metadata)
        except CurveError as error:
            if error.status:
                self.answers += make_frame(
                    b"\x05ERROR" + bytes([len(error.status)]) + error.status, _COMMAND_FLAG
                )
            raise ZmtpError(str(error)) from None
        self.answers += make_frame(answer, _COMMAND_FLAG)
        self.is_ready = channel.is_ready
        return []

    def _open_sealed(self, channel: CurveChannel, data: bytes) -> tuple[int, bytes]:
        """Decrypts a frame. Returns its content, and its flags as in an unencrypted frame."""
        from enliven.keys.curve import CurveError

        try:
            flags, plain = channel.decrypt(data)
        except CurveError as error:
            raise ZmtpError(str(error)) from None
        return (flags & _MORE_FLAG) | (_COMMAND_FLAG if flags & _CURVE_COMMAND_FLAG else 0), plain

    def _next_frame(self) -> tuple[int, bytes] | None:
        """Returns (flags, data) of the next complete frame, or None."""
        have = len(self._bytes) - self._at
        if have < 2:
            return None
        flags, length, start = self._bytes[self._at], self._bytes[self._at + 1], self._at + 2
        if flags & ~(_MORE_FLAG | _LONG_FLAG | _COMMAND_FLAG):
            raise ZmtpError(f"a frame has the invalid flags {flags}")
        if flags & _LONG_FLAG:
            if have < 9:
                return None
            (length,), start = struct.unpack_from(">Q", self._bytes, self._at + 1), self._at + 9
        max_bytes = self._most
        if self.channel is not None:
            max_bytes = max_bytes + _MIN_SEALED_BYTES if self.is_ready else _MAX_HANDSHAKE_BYTES
        if length > max_bytes:
            raise ZmtpError(f"a frame has {length} bytes, but the limit is {max_bytes}")
        self.missing = max(start + length - len(self._bytes), 0)
        if self.missing:
            return None
        self._at = start + length
        return flags, bytes(self._bytes[start : self._at])

    def _handle_command(self, data: bytes) -> list[bytes]:
        """Handles a handshake, a PING or a subscription. An unknown command is ignored."""
        name, rest = data[1 : 1 + data[0]] if data else b"", data[1 + data[0] :] if data else b""
        if name == b"READY" and not self.is_ready:
            self.is_ready = True
        elif name == b"ERROR" or not self.is_ready:
            raise ZmtpError("the peer did not complete the handshake")
        elif name == b"PING":
            context = rest[_TTL_BYTES : _TTL_BYTES + _MAX_CONTEXT_BYTES]
            pong = b"\x04PONG" + context
            channel = self.channel
            self.answers += (
                make_frame(pong, _COMMAND_FLAG)
                if channel is None
                else make_frame(channel.encrypt(pong, _CURVE_COMMAND_FLAG))
            )
        elif name == b"SUBSCRIBE":
            return [b"\x01" + rest]
        elif name == b"CANCEL":
            return [b"\x00" + rest]
        return []
