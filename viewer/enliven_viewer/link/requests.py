"""Requests to one edge: numbered, sent without waiting, matched with their replies, given up in time."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import zmq

from enliven.wire import (
    REPLY,
    Answer,
    Ask,
    Endpoint,
    Malformed,
    Reply,
    Request,
    make_socket,
    pack_control,
    unpack_control,
)


@dataclass
class _Pending:
    key: str
    deadline: float
    on_reply: Callable[[Answer | None], None]


class Requests:
    """A DEALER socket and its unanswered requests."""

    def __init__(self, context: zmq.Context[Any], endpoint: Endpoint) -> None:
        self._socket = make_socket(context, zmq.DEALER, REPLY.max_bytes + 64)
        # A request must not wait in a queue for an edge that starts an hour later.
        self._socket.setsockopt(zmq.IMMEDIATE, 1)
        self._socket.connect(endpoint.control_address)
        self._pending: dict[int, _Pending] = {}
        self._last = 0

    def under_way(self, prefix: str) -> int:
        """Number of unanswered requests with a key that begins with ``prefix``."""
        return sum(p.key.startswith(prefix) for p in self._pending.values())

    def send(self, body: Ask, key: str, seconds: float, on_reply: Callable[[Answer | None], None]) -> bool:
        """Send, without waiting; False where there is no edge to take it.

        Args:
            key: what it is about, see :meth:`under_way`.
            seconds: how long to wait for the reply.
            on_reply: called from :meth:`poll` with the reply, or None when the time is up.
        """
        self._last += 1
        try:
            self._socket.send(pack_control(Request(self._last, body)), zmq.DONTWAIT)
        except zmq.ZMQError:
            return False
        self._pending[self._last] = _Pending(key, time.monotonic() + seconds, on_reply)
        return True

    def poll(self, malformed: Callable[[Malformed], None], most: int = 256) -> None:
        """Call back each request that was answered, with its reply, and each that timed out, with None."""
        for _ in range(most):
            try:
                parts = self._socket.recv_multipart(zmq.DONTWAIT)
            except zmq.Again:
                break
            try:
                if len(parts) != 1:
                    raise Malformed("reply", f"{len(parts)} parts instead of one")
                reply: Reply = unpack_control(parts[0], REPLY)
            except Malformed as error:
                malformed(error)
                continue
            pending = self._pending.pop(reply.id, None)
            if pending is not None:
                pending.on_reply(reply.body)
        now = time.monotonic()
        for number in [n for n, p in self._pending.items() if p.deadline < now]:
            self._pending.pop(number).on_reply(None)

    def forget(self) -> None:
        """Give up every unanswered request, since the edge is gone."""
        pending, self._pending = self._pending, {}
        for each in pending.values():
            each.on_reply(None)

    def close(self) -> None:
        """Let the socket go."""
        with contextlib.suppress(zmq.ZMQError):
            self._socket.close(linger=0)
