"""The socket that receives the messages of an edge's streams."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import zmq

from enliven.errors import EnlivenError
from enliven.keys.client import ClientKeys, HandshakeMonitor, handshake_advice
from enliven.wire import MAX_STREAM_BYTES, MAX_UNREAD_STREAMS, Endpoint, make_socket

_REOPEN_INTERVAL_S = 2.0
"""Seconds from a failed handshake to the next attempt. In the meantime the user may pair with the edge."""


class StreamSocket:
    """A ZeroMQ SUB socket that is replaced when the edge refuses its keys.

    Args:
        endpoint: address of the edge, which need not be running yet.
        keys: this viewer's keys for the edge, or None for an edge without encryption.
        report: called with the text of a problem with the keys, once per problem.
        reopened: called with the new keys after the socket was replaced.

    Attributes:
        problem: why the edge refuses this viewer, as one sentence; empty while it does not.
        socket: the present SUB socket.
    """

    def __init__(
        self,
        context: zmq.Context[Any],
        endpoint: Endpoint,
        keys: ClientKeys | None,
        report: Callable[[str], None],
        reopened: Callable[[ClientKeys | None], None],
    ) -> None:
        self._context, self._endpoint = context, endpoint
        self._report, self._reopened = report, reopened
        self.problem, self._reopen_at = "", math.inf
        self._open(keys)

    def receive(self) -> bytes | None:
        """Returns the next message without waiting, or None if none has arrived."""
        try:
            return b"".join(self.socket.recv_multipart(zmq.DONTWAIT))
        except zmq.Again:
            return None

    def watch_handshake(self) -> None:
        """Reports a failed handshake. Reconnects later, because libzmq does not retry after wrong keys."""
        self._handshake.poll()
        failure, now = self._handshake.problem, time.monotonic()
        if failure and self._reopen_at == math.inf:
            self._reopen_at = now + _REOPEN_INTERVAL_S
            advice = handshake_advice(failure, self._endpoint.host)
            self._set_problem(f"the edge at {self._endpoint} {advice}")
        elif now >= self._reopen_at:
            self._reopen(now)

    def close(self) -> None:
        """Closes the socket."""
        self._handshake.close()
        self.socket.close(linger=0)

    def _open(self, keys: ClientKeys | None) -> None:
        """Opens the socket and connects it to the edge's streams."""
        self.socket = make_socket(self._context, zmq.SUB, MAX_STREAM_BYTES, MAX_UNREAD_STREAMS, keys)
        self._handshake = HandshakeMonitor(self.socket, keys is not None)
        self.socket.setsockopt(zmq.SUBSCRIBE, b"")
        self.socket.connect(self._endpoint.stream_address)

    def _reopen(self, now: float) -> None:
        """Replaces the socket by one with the keys that are on disk now."""
        self._reopen_at = math.inf
        try:
            keys = self._endpoint.find_keys()
        except EnlivenError as error:
            self._reopen_at = now + _REOPEN_INTERVAL_S
            self._set_problem(str(error))
            return
        self.close()
        self._open(keys)
        self._reopened(keys)

    def _set_problem(self, text: str) -> None:
        if text != self.problem:
            self.problem = text
            self._report(text)
