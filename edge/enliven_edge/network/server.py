"""A ZMTP server on one TCP port. Its cost per frame does not depend on its peers.

All work is done in :meth:`ZmtpServer.messages` and :meth:`ZmtpServer.send`, on the caller's thread and within
the caller's time limit. Unread bytes stay in the system's buffers, and in the sender's buffers when these are
full. A flood therefore costs the edge a fixed time per frame, and no memory.
"""

from __future__ import annotations

import itertools
import logging
import selectors
import socket
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, Literal

from enliven.wire import ZmtpError, ZmtpSession
from enliven_edge.network.connection import Connection
from enliven_edge.network.tcp_listener import configure_socket, limit_connections, listen

if TYPE_CHECKING:
    from enliven.keys.curve import CurveServer

log = logging.getLogger(__name__)

MAX_CONNECTIONS = 200
"""Maximum number of connections of one server. With it, two servers stay below the limit of ``select`` on
Windows (512)."""
_HANDSHAKE_TIMEOUT_S = 3.0
"""Maximum seconds from connecting to the first valid message. A connection that sends no valid message in
this time is closed.
"""
_STALL_TIMEOUT_S = 10.0
"""Seconds without accepting any queued byte after which a connection is closed."""
_QUIET_TIMEOUT_S = 10.0
"""Seconds without a message after which a new peer may replace a connection. A viewer sends ten pings in this
time."""
_IDLE_TIMEOUT_S = 0.25
"""Seconds without a byte after which a connection that is in its handshake may be replaced."""
_KNOWN_AFTER_S = 1.0
"""Seconds of service after which a connection counts as known. A flood of new connections does not delay
known ones."""
_MAX_SERVICE_S = 60.0
"""Maximum seconds of service that count. So a viewer that was served for an hour has no priority over one
that was served for a minute."""
_RESERVED_FRACTION = 0.5
"""Fraction of an address's connections that is reserved for the connections that were served longest."""
_HEARD_ONCE_S = 0.05
"""Maximum seconds from the first to the last message of a connection that counts as heard only once."""
_MAX_ACCEPTS_PER_POLL = 32
"""Maximum number of connections accepted in one poll. The system queues the others until the next poll."""
_MIN_ACCEPTS_PER_POLL = 8
"""Number of connections accepted in a poll even if its time is used up. In a flood of connections, a new
connection is kept for six polls, and needs three for its handshake."""
_CLEANUP_INTERVAL_S = 0.25
"""Seconds between two searches for connections to close."""
_READ_BYTES = 4096
"""Number of bytes that are read from a connection before the next connection is served. It also applies to
the rest of a longer message."""
_FRAMES_PER_TURN = 16
"""Maximum number of frames handled for one connection before the next connection's turn."""


class ZmtpServer:
    """Listens on a TCP port and speaks ZMTP with the peers that connect.

    The peer with the lowest cost of recent messages is read first, so that a flood does not delay the others.
    If the server is full, a new connection replaces the first of these that exists:

    1. a connection without a complete handshake;
    2. with keys, a connection of an unpaired peer;
    3. for a ROUTER, the connection that was silent longest, for at least ``_QUIET_TIMEOUT_S``;
    4. a connection of the address with the most connections, which may be the address of the new connection.
       The connections that were served longest are kept.

    If every address has only one connection, the new connection is closed.

    Args:
        host, port, option: as for :func:`~enliven_edge.network.tcp_listener.listen`.
        kind: "ROUTER" answers requests, "PUB" sends to subscribers.
        most_bytes: maximum bytes of a frame from a peer.
        max_connections: maximum number of connections. The limit is lower if the process may not open this
            number.
        curve: the edge's keys, and the peers that it admits; None without keys.

    Attributes:
        port: the port that it listens on.

    Raises:
        ResourceError: for a port in use, or an address that does not belong to this machine.
    """

    def __init__(
        self,
        host: str,
        port: int,
        option: str,
        kind: Literal["ROUTER", "PUB"],
        most_bytes: int,
        max_connections: int = MAX_CONNECTIONS,
        curve: CurveServer | None = None,
    ) -> None:
        self._curve = curve
        self._listener = listen(host, port, option)
        self.port: int = self._listener.getsockname()[1]
        self._kind: Literal["ROUTER", "PUB"] = kind
        self._most_bytes, self._most = most_bytes, limit_connections(max_connections)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._open: dict[Connection, int] = {}
        self._unsent: set[Connection] = set()
        self._last_cleanup_at = 0.0
        self._has_logged_full = False

    @property
    def connections(self) -> Iterable[Connection]:
        """Returns all open connections."""
        return self._open.keys()

    def messages(self, until: float) -> Iterator[tuple[Connection, list[bytes]]]:
        """Yields the messages since the last call that can be read until a monotonic time in seconds.

        The time that the caller spends on a message is charged to the message's sender.
        """
        self._close_overdue()
        readable = {key.fileobj for key, _ in self._selector.select(0)}
        # Spend at most half of the budget on sending, so that a fast reader cannot starve requests.
        now = time.monotonic()
        self._flush(now + 0.5 * (until - now))
        yield from self._read(readable, until)
        if self._listener in readable:
            self._accept_connections(until)

    def _read(self, readable: set[Any], until: float) -> Iterator[tuple[Connection, list[bytes]]]:
        """Yields the messages of the connected peers. The peers take turns after a limited number of
        bytes.
        """
        ready = [c for c in self._open if not c.is_busy and (c.buffered or c in readable)]
        while ready:
            unfinished = []
            for connection in _order_by_turn(ready):
                if time.monotonic() >= until:
                    return
                yield from self._read_turn(connection, until)
                has_more = connection.buffered or connection.streaming
                if connection.is_open and not connection.is_busy and has_more:
                    unfinished.append(connection)
            ready = unfinished

    def send(self, connection: Connection, first: bytes, rest: bytes = b"") -> None:
        """Sends a message of one part, given as two byte strings. It is dropped if the connection is
        closed.
        """
        if connection.is_open:
            connection.queue_message(first, rest)
            self._send_pending(connection, time.monotonic())

    def send_messages(self, connection: Connection, messages: Iterable[bytes]) -> None:
        """Sends several messages of one part. They are dropped if the connection is closed."""
        if connection.is_open:
            for data in messages:
                connection.queue_message(data)
            self._send_pending(connection, time.monotonic())

    def send_raw(self, connection: Connection, frame: bytes) -> None:
        """Sends bytes that are already framed."""
        if connection.is_open:
            connection.queue(frame)
            self._send_pending(connection, time.monotonic())

    def drain(self, seconds: float) -> None:
        """Sends queued bytes, for at most ``seconds``."""
        deadline = time.monotonic() + seconds
        while self._unsent and time.monotonic() < deadline:
            self._flush(deadline)
            time.sleep(0.001)

    def close(self) -> None:
        """Releases the port and all connections."""
        for connection in list(self._open):
            self.close_connection(connection)
        self._selector.close()
        self._listener.close()

    def close_connection(self, connection: Connection) -> None:
        """Closes a connection."""
        if self._open.pop(connection, None) is not None:
            self._selector.unregister(connection)
            self._unsent.discard(connection)
        connection.close()

    def _read_turn(self, connection: Connection, until: float) -> Iterator[tuple[Connection, list[bytes]]]:
        """Reads and handles the bytes and frames of one connection, for at most one turn."""
        start, session, requested_count = time.monotonic(), connection.session, 0
        try:
            if not connection.buffered:
                requested_count = max(_READ_BYTES, session.missing)
                data = connection.read(requested_count)
                connection.streaming = data is not None and len(data) == requested_count
                if data is None:
                    return
                if not data:
                    raise ZmtpError("the end")
                session.feed(data)
                connection.last_read_at = time.monotonic()
                connection.buffered = True
            for _ in range(_FRAMES_PER_TURN):
                parts = session.read_message()
                if parts is None:
                    connection.buffered = False
                    connection.streaming &= max(requested_count, session.missing) > _READ_BYTES
                    break
                if parts:
                    yield connection, parts
                if session.answers and connection.is_open:
                    connection.queue(bytes(session.answers))
                    session.answers.clear()
                if connection.is_busy or time.monotonic() >= until:
                    break
            self._queue_answers(connection)
            self._send_pending(connection, until)
        except ZmtpError:
            # The session may have queued the reason of the failure. Send it before closing.
            self._queue_answers(connection)
            self._send_pending(connection, until)
            self.close_connection(connection)
        except OSError:
            self.close_connection(connection)
        finally:
            connection.add_cost(time.monotonic() - start)

    def _queue_answers(self, connection: Connection) -> None:
        """Queues the session's own messages, such as the greeting."""
        if connection.is_open and connection.session.answers:
            connection.queue(bytes(connection.session.answers))
            connection.session.answers.clear()

    def _send_pending(self, connection: Connection, until: float) -> None:
        """Sends as much as the system accepts now. The rest is sent in the next poll."""
        if not connection.is_open:
            return
        try:
            connection.flush(until)
        except OSError:
            self.close_connection(connection)
            return
        (self._unsent.add if connection.unsent_bytes else self._unsent.discard)(connection)

    def _flush(self, until: float) -> None:
        """Sends queued bytes, first to the peers with the least cost."""
        for connection in sorted(self._unsent, key=lambda c: c.cost):
            start = time.monotonic()
            self._send_pending(connection, until)
            connection.add_cost(time.monotonic() - start)
            if time.monotonic() >= until:
                return

    def _close_overdue(self) -> None:
        """Closes connections that are late with their handshake, or that do not accept sent bytes."""
        now = time.monotonic()
        if now - self._last_cleanup_at < _CLEANUP_INTERVAL_S:
            return
        self._last_cleanup_at = now
        for connection in list(self._open):
            overdue = not connection.introduced and now - connection.opened > _HANDSHAKE_TIMEOUT_S
            if overdue or (connection.unsent_bytes and now - connection.last_progress_at > _STALL_TIMEOUT_S):
                self.close_connection(connection)

    def _accept_connections(self, until: float) -> None:
        for count in range(_MAX_ACCEPTS_PER_POLL):
            is_full = len(self._open) >= self._most
            if count >= _MIN_ACCEPTS_PER_POLL and (is_full or time.monotonic() >= until):
                return
            # If the server is full, connections in the middle of their handshake have priority. Leave the
            # others in the queue of the operating system.
            if is_full and any(not c.introduced for c in self._open) and not self._find_idle():
                return
            try:
                accepted, address = self._listener.accept()
            except BlockingIOError:
                return
            except OSError as error:
                log.debug("a connection could not be accepted (%s)", error)
                return
            self._keep_connection(accepted, str(address[0]))

    def _keep_connection(self, accepted: socket.socket, address: str) -> None:
        """Keeps an accepted connection if there is room, or if another connection can be dropped."""
        if len(self._open) >= self._most:
            if not self._has_logged_full:
                log.warning(
                    "all %d connections of port %d are in use; this is logged only once",
                    self._most,
                    self.port,
                )
                self._has_logged_full = True
            dropped = self._choose_dropped(address)
            if dropped is None:
                accepted.close()
                return
            self.close_connection(dropped)
        connection = Connection(accepted, address, ZmtpSession(self._kind, self._most_bytes, self._curve))
        try:
            configure_socket(accepted)
            self._selector.register(connection, selectors.EVENT_READ)
        except (OSError, ValueError):
            connection.close()
            return
        self._open[connection] = connection.fileno()
        self._queue_answers(connection)
        self._send_pending(connection, time.monotonic())

    def _choose_dropped(self, address: str) -> Connection | None:
        """Returns the connection that is dropped for a new one from an address, or None if none may be
        dropped.
        """
        idle = self._find_idle()
        if idle:
            crowd = Counter(c.address for c in idle)
            return max(idle, key=lambda c: (crowd[c.address], -c.opened))
        if self._curve is not None:
            strangers = [c for c in self._open if c.session.channel is None or not c.session.is_ready]
            if strangers:
                return min(strangers, key=lambda c: c.opened)
        if self._kind == "ROUTER":
            quietest = min(self._open, key=lambda c: c.last_message_at)
            if time.monotonic() - quietest.last_message_at > _QUIET_TIMEOUT_S:
                return quietest
        crowd = Counter(c.address for c in self._open)
        max_count = max(crowd.values())
        if max_count == 1:
            return None
        crowded = {crowd_address for crowd_address, count in crowd.items() if count == max_count}
        crowded = {address} if address in crowded else crowded
        return self._find_least_served([c for c in self._open if c.address in crowded])

    def _find_idle(self) -> list[Connection]:
        """Returns the connections that have not started their handshake, or stopped in the middle of it."""
        idle_since = time.monotonic() - _IDLE_TIMEOUT_S
        return [
            c
            for c in self._open
            if not c.introduced and (c.last_read_at == c.opened or c.last_read_at < idle_since)
        ]

    def _find_least_served(self, crowd: list[Connection]) -> Connection:
        """Returns the connection of a crowded address that is dropped for a new one.

        The connections that were served longest stay. Among the others, a connection that was heard only once
        is dropped first, then the oldest one. So a new connection stays long enough to be served.
        """
        kept_count = int(_RESERVED_FRACTION * len(crowd))
        droppable = sorted(crowd, key=lambda c: (-c.service_s, c.opened))[kept_count:]
        return min(droppable, key=lambda c: (c.service_s > _HEARD_ONCE_S, c.opened))


def _order_by_turn(ready: list[Connection]) -> list[Connection]:
    """Returns connections in reading order: known, recent and new connections alternate.

    Recent connections are sorted by the time that their recent messages cost. Known connections are sorted by
    this time divided by their time of service. Among new connections, those that have started their handshake
    come first.
    """
    known_peers = [c for c in ready if c.service_s > _KNOWN_AFTER_S]
    known_peers.sort(key=lambda c: c.cost / min(c.service_s, _MAX_SERVICE_S))
    recent = [c for c in ready if c.introduced and c.service_s <= _KNOWN_AFTER_S]
    newcomers = [c for c in ready if not c.introduced and c.service_s <= _KNOWN_AFTER_S]
    recent.sort(key=lambda c: c.cost)
    newcomers.sort(key=lambda c: (c.last_read_at == c.opened, c.opened))
    rounds = itertools.zip_longest(known_peers, recent, newcomers)
    return [peer for round_peers in rounds for peer in round_peers if peer is not None]
