"""Exchanges messages between a program and the process of its live outputs, over a pair of connected
sockets."""

from __future__ import annotations

import pickle
import socket
import struct
import sys
from collections.abc import Sequence
from typing import Any

_LENGTH = struct.Struct("<I")
_BUFFER_BYTES = 1 << 20
"""Requested size in bytes of the socket buffer for messages that were not read yet. The system may provide
less."""
_READ_BYTES = 1 << 16
"""Maximum number of bytes per read."""


class MessageStream:
    """One end of the connection. One thread may read while another thread writes.

    Args:
        end: the socket. :meth:`send_without_waiting` and :meth:`flush` require a non-blocking socket.
    """

    def __init__(self, end: socket.socket) -> None:
        self.socket = end
        self._unsent, self._received = memoryview(b""), bytearray()

    def send_without_waiting(self, kind: str, content: object) -> bool:
        """Sends a message without blocking. If the socket buffer is full, :meth:`flush` must send the
        remaining bytes.

        Call it only after :meth:`flush` has returned True. Returns True if the whole message was sent.

        Raises:
            OSError: if the other end is closed.
        """
        self._unsent = memoryview(_convert_to_bytes(kind, content))
        return self.flush()

    def flush(self) -> bool:
        """Sends the remaining bytes of the last message without blocking. Returns True if no byte remains.

        Raises:
            OSError: if the other end is closed.
        """
        while self._unsent:
            try:
                self._unsent = self._unsent[self.socket.send(self._unsent) :]
            except BlockingIOError:
                return False
        return True

    def send(self, kind: str, content: object) -> None:
        """Sends a message, and blocks until it is in the socket buffer.

        Raises:
            OSError: if the other end is closed.
        """
        self.socket.sendall(_convert_to_bytes(kind, content))

    def receive(self) -> list[tuple[str, Any]] | None:
        """Reads once from the socket, and returns the messages that are complete. Returns None if the other
        end is closed."""
        try:
            data = self.socket.recv(_READ_BYTES)
        except BlockingIOError:
            return []
        except OSError:
            return None
        if not data:
            return None
        self._received += data
        messages, start = [], 0
        while len(self._received) >= start + _LENGTH.size:
            end = start + _LENGTH.size + _LENGTH.unpack_from(self._received, start)[0]
            if len(self._received) < end:
                break
            messages.append(pickle.loads(memoryview(self._received)[start + _LENGTH.size : end].tobytes()))
            start = end
        del self._received[:start]
        return messages


def _convert_to_bytes(kind: str, content: object) -> bytes:
    data = pickle.dumps((kind, content), pickle.HIGHEST_PROTOCOL)
    return _LENGTH.pack(len(data)) + data


def make_connected_ends() -> tuple[socket.socket, socket.socket]:
    """Returns two connected sockets with large buffers.

    Raises:
        OSError: if the system cannot create the sockets.
    """
    near, far = socket.socketpair()
    near.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
    return near, far


def open_inherited_end(arguments: Sequence[str]) -> socket.socket:
    """Returns this process's end of the connection. Its descriptor is a command line argument, or on Windows
    data on the standard input."""
    if sys.platform == "win32":
        return socket.fromshare(sys.stdin.buffer.read())
    return socket.socket(fileno=int(arguments[0]))
