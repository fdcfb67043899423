"""Requests to one edge: numbered, non-blocking, matched with their replies, with timeouts."""

from __future__ import annotations

import contextlib
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import zmq

from enliven.keys.client import ClientKeys
from enliven.wire import (
    MAX_UNREAD_REPLIES,
    REPLY,
    Answer,
    Ask,
    Endpoint,
    MalformedMessageError,
    Reply,
    Request,
    make_socket,
    pack_control,
    reply_number,
    unpack_control,
)

POLL_BUDGET_S = 0.005
"""Maximum time in seconds that one poll spends on replies. The next poll handles the remaining replies."""
_MAX_LATE_REQUESTS = 256
"""Maximum number of stored timed-out requests. Late replies to them are ignored and do not count as
unrequested.
"""
_MAX_UNREQUESTED_BYTES = 4 * 1024 * 1024
"""Maximum size in bytes of unrequested replies before the connection is closed."""
_RECONNECT_DELAY_S = 2.0
"""Seconds until the viewer reconnects to an edge that has sent too many unrequested replies."""


@dataclass
class _PendingRequest:
    key: str
    deadline: float
    on_reply: Callable[[Answer | None], None]


class Requests:
    """A ZeroMQ DEALER socket and its unanswered requests. Replies to other requests are not decoded."""

    def __init__(self, context: zmq.Context[Any], endpoint: Endpoint, keys: ClientKeys | None = None) -> None:
        self._context, self._endpoint, self._keys = context, endpoint, keys
        self._socket: zmq.Socket[bytes] | None = None
        self._pending: dict[int, _PendingRequest] = {}
        self._late: deque[int] = deque(maxlen=_MAX_LATE_REQUESTS)
        self._last = 0
        self._unrequested_bytes = 0
        self._reopen_at = 0.0
        self._open()

    def count_pending(self, prefix: str) -> int:
        """Returns the number of unanswered requests with a key that begins with ``prefix``."""
        return sum(p.key.startswith(prefix) for p in self._pending.values())

    def send(self, body: Ask, key: str, seconds: float, on_reply: Callable[[Answer | None], None]) -> bool:
        """Sends a request without blocking. Returns False without a connection to an edge.

        Args:
            key: subject of the request, see :meth:`count_pending`.
            seconds: timeout of the reply.
            on_reply: called from :meth:`poll` with the reply, or with None after the timeout.
        """
        if self._socket is None:
            return False
        self._last += 1
        try:
            self._socket.send(pack_control(Request(self._last, body)), zmq.DONTWAIT)
        except zmq.ZMQError:
            return False
        self._pending[self._last] = _PendingRequest(key, time.monotonic() + seconds, on_reply)
        return True

    def poll(self, malformed: Callable[[MalformedMessageError], None]) -> None:
        """Calls back each answered request with its reply, and each timed-out request with None."""
        if self._socket is None and time.monotonic() >= self._reopen_at:
            self._open()
        deadline = time.monotonic() + POLL_BUDGET_S
        while self._socket is not None and time.monotonic() < deadline:
            try:
                parts = self._socket.recv_multipart(zmq.DONTWAIT)
            except zmq.Again:
                break
            try:
                self._handle_reply(parts)
            except MalformedMessageError as error:
                malformed(error)
        now = time.monotonic()
        for number in [n for n, p in self._pending.items() if p.deadline < now]:
            self._late.append(number)
            self._pending.pop(number).on_reply(None)

    def forget(self) -> None:
        """Drops all unanswered requests, because the edge is gone."""
        pending, self._pending = self._pending, {}
        self._late.extend(pending)
        for request in pending.values():
            request.on_reply(None)

    def reopen(self, keys: ClientKeys | None) -> None:
        """Reconnects with other keys. Drops unanswered requests."""
        self.close()
        self.forget()
        self._keys = keys
        self._open()

    def close(self) -> None:
        """Closes the socket."""
        if self._socket is not None:
            with contextlib.suppress(zmq.ZMQError):
                self._socket.close(linger=0)
        self._socket = None

    def _open(self) -> None:
        """Opens the socket and connects it to the edge."""
        self._unrequested_bytes = 0
        max_bytes = REPLY.max_bytes + 64
        self._socket = make_socket(self._context, zmq.DEALER, max_bytes, MAX_UNREAD_REPLIES, self._keys)
        # Send only over an existing connection (IMMEDIATE). Otherwise a request would wait in a queue for an
        # edge that may start an hour later.
        self._socket.setsockopt(zmq.IMMEDIATE, 1)
        self._socket.connect(self._endpoint.control_address)

    def _handle_reply(self, parts: list[bytes]) -> None:
        """Processes one reply.

        Raises:
            MalformedMessageError: if it cannot be read, or does not belong to a request.
        """
        if len(parts) != 1:
            self._count_unasked(sum(map(len, parts)))
            raise MalformedMessageError("reply", f"the reply has {len(parts)} message parts instead of one")
        number = reply_number(parts[0])
        if number not in self._pending:
            if number in self._late:
                self._late.remove(number)
                return
            self._count_unasked(len(parts[0]))
            raise MalformedMessageError("reply", "the reply does not belong to any request")
        reply: Reply = unpack_control(parts[0], REPLY)
        self._pending.pop(number).on_reply(reply.body)

    def _count_unasked(self, size: int) -> None:
        """Counts unrequested bytes. Closes the connection after too many of them."""
        self._unrequested_bytes += size
        if self._unrequested_bytes > _MAX_UNREQUESTED_BYTES:
            self.close()
            self._reopen_at = time.monotonic() + _RECONNECT_DELAY_S
            self.forget()
