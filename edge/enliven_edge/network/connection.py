"""One connection of a server: its send queue and its recent cost."""

from __future__ import annotations

import socket
import time
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from typing import Any

from enliven.wire import ZmtpSession, frame_header, make_frame
from enliven_edge.network.tcp_listener import receive_stamped

_COST_HALF_LIFE_S = 10.0
"""Half-life in seconds of a connection's recorded cost, so that an earlier flood has no lasting effect."""
_SEND_BYTES = 1 << 18
"""Number of bytes that are passed to the system in one call."""
_MAX_INLINE_SEAL_BYTES = 1 << 20
"""Maximum bytes that are encrypted on the calling thread, which takes 2 ms. A longer message, such as a
character, is encrypted on another thread while the edge continues."""
_SEAL_OVERHEAD = 42
"""Bytes that a long message grows by when it is encrypted and framed."""
MAX_PENDING_ORDERS = 32
"""Maximum number of pending orders of one connection. While it is reached, nothing more is read from the
connection."""


class Connection:
    """A peer and its send queue. The server creates and closes it.

    Attributes:
        address: the peer's address, without the port.
        session: the peer's ZMTP session.
        introduced: True after a valid message. A connection that sends none in time is closed.
        last_message_at: monotonic time of its last message, seconds.
        last_read_at: monotonic time when its last bytes were read, seconds.
        arrived_ns: wall-clock time in nanoseconds at which its last bytes arrived at this machine; 0 if
            unknown.
        last_progress_at: monotonic time when bytes were last sent, or when the queue was last empty, seconds.
        streaming: True if the peer is sending a long message, so that more bytes are probably available.
        pending: number of its orders that are not carried out yet.
        state: data of the server's user about the connection.
        pairing: the pairing that the peer has begun, or None.
    """

    def __init__(self, peer_socket: socket.socket, address: str, session: ZmtpSession) -> None:
        self.address, self.session = address, session
        self.opened = self.last_message_at = self.last_read_at = self.last_progress_at = time.monotonic()
        self.introduced = self.buffered = self.streaming = False
        self.arrived_ns = 0
        self.pending = 0
        self.state: Any = None
        self.pairing: Any = None
        self._socket: socket.socket | None = peer_socket
        self._outbox: deque[memoryview | Future[bytes]] = deque()
        self.unsent_bytes = 0
        self._cost, self._weighed = 0.0, self.opened

    @property
    def is_open(self) -> bool:
        """Returns True until the connection is closed."""
        return self._socket is not None

    @property
    def service_s(self) -> float:
        """Returns the seconds from the connection's start to its last message, or to the last bytes that the
        peer accepted.
        """
        return max(self.last_message_at, self.last_progress_at) - self.opened

    @property
    def is_busy(self) -> bool:
        """Returns True if nothing is read from the peer at present.

        This is so if the peer does not accept replies, or if many of its orders are pending.
        """
        return self.unsent_bytes > 0 or self.pending >= MAX_PENDING_ORDERS

    @property
    def cost(self) -> float:
        """Returns the seconds of the edge's time that the connection used recently."""
        return self._cost * 0.5 ** ((time.monotonic() - self._weighed) / _COST_HALF_LIFE_S)

    def add_cost(self, seconds: float) -> None:
        """Adds seconds to the cost."""
        self._cost, self._weighed = self.cost + seconds, time.monotonic()

    def fileno(self) -> int:
        """Returns the file descriptor, or -1 if the connection is closed."""
        return self._socket.fileno() if self._socket is not None else -1

    def read(self, max_bytes: int) -> bytes | None:
        """Returns received bytes, ``b""`` at the end of the stream, or None if nothing has arrived.

        Raises:
            OSError: if the connection is broken.
        """
        if self._socket is None:
            return b""
        try:
            data, self.arrived_ns = receive_stamped(self._socket, max_bytes)
        except BlockingIOError:
            return None
        return data

    def queue(self, *pieces: bytes) -> None:
        """Adds pieces of bytes to the send queue."""
        if not self.unsent_bytes:
            self.last_progress_at = time.monotonic()
        for piece in pieces:
            self._outbox.append(memoryview(piece))
            self.unsent_bytes += len(piece)

    def queue_message(self, first: bytes, rest: bytes = b"") -> None:
        """Queues a message of one part with its data in two pieces, encrypted if the peer has keys.

        Without encryption, a long piece is shared, not copied.
        """
        channel = self.session.channel
        if channel is None:
            self.queue(frame_header(len(first) + len(rest)) + first, rest)
        elif len(first) + len(rest) <= _MAX_INLINE_SEAL_BYTES:
            self.queue(make_frame(channel.encrypt(first + rest)))
        else:
            if not self.unsent_bytes:
                self.last_progress_at = time.monotonic()
            # Reserve the message's counter now, because counters must increase in the order of sending.
            count = channel.reserve_count()
            self._outbox.append(
                _encryption_thread().submit(lambda: make_frame(channel.encrypt(first + rest, 0, count)))
            )
            self.unsent_bytes += len(first) + len(rest) + _SEAL_OVERHEAD

    def flush(self, until: float) -> None:
        """Sends as much as the system accepts now.

        A large piece is sent only until a monotonic time in seconds.

        Raises:
            OSError: if the connection is broken.
        """
        while self._outbox and self._socket is not None:
            piece = self._outbox[0]
            if isinstance(piece, Future):
                if not piece.done():
                    return
                piece = self._outbox[0] = memoryview(piece.result())
            try:
                sent_bytes = self._socket.send(piece[:_SEND_BYTES]) if piece else 0
            except BlockingIOError:
                return
            self.unsent_bytes -= sent_bytes
            self.last_progress_at = time.monotonic()
            if sent_bytes == _SEND_BYTES < len(piece) and self.last_progress_at > until:
                self._outbox[0] = piece[sent_bytes:]
                return
            if sent_bytes == len(piece):
                self._outbox.popleft()
            else:
                self._outbox[0] = piece[sent_bytes:]
        self.last_progress_at = time.monotonic()

    def close(self) -> None:
        """Closes the connection. Unsent bytes are lost."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        self._outbox.clear()
        self.unsent_bytes = 0


@cache
def _encryption_thread() -> ThreadPoolExecutor:
    """Returns the thread that encrypts long messages of all connections."""
    return ThreadPoolExecutor(1, "sealer")
