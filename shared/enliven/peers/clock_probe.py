"""Measures the clock offset of one edge, on a separate thread with a separate connection.

A window reads its sockets once per frame, so it would receive each answer up to 16 ms late. This thread waits
for the answers, so it receives them within 0.1 ms.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from typing import Any

import zmq

from enliven.errors import EnlivenError
from enliven.keys.client import ClientKeys
from enliven.peers.clock_sync import ClockExchange, ClockSync
from enliven.wire import (
    REPLY,
    Endpoint,
    MalformedMessageError,
    Ping,
    Pong,
    Reply,
    Request,
    make_socket,
    pack_control,
    unpack_control,
)

log = logging.getLogger(__name__)

_MAX_REPLY_BYTES = 4096
"""Maximum size of an answer in bytes. The answer to a probe has 60 bytes."""
_MAX_UNREAD = 16
"""Maximum number of unread answers, for two bursts."""
_MAX_WAIT_MS = 200
"""Maximum time in milliseconds of one wait for an answer. It is short, so that :meth:`ClockProbe.close`
returns soon."""
_MAX_FAILED_BURSTS = 2
"""Number of unanswered bursts after which the thread reconnects, with the current keys."""


class ClockProbe:
    """A thread that sends probes to an edge, from its construction until :meth:`close`.

    Args:
        endpoint: address of the edge, which need not be running yet.
        name: name of this viewer.

    Attributes:
        sync: the estimate of the offset.
    """

    def __init__(self, endpoint: Endpoint, name: str) -> None:
        self.sync = ClockSync()
        self._endpoint, self._name = endpoint, name[:64] or "viewer"
        self._number = 0
        self._sent: dict[int, int] = {}
        self._closed = threading.Event()
        # msgspec crashes if two threads build the same decoder at the same time. So build the decoder of the
        # answers before the thread starts.
        unpack_control(pack_control(Reply(0, Pong(0, 0))), REPLY)
        self._thread = threading.Thread(target=self._run, name="clock probe", daemon=True)
        self._thread.start()

    @property
    def is_known(self) -> bool:
        """True if the offset is known."""
        return self.sync.is_known

    def offset_ns(self) -> int:
        """Returns the current offset in nanoseconds: the edge's wall clock minus this machine's monotonic
        clock.
        """
        return self.sync.offset_ns(time.monotonic_ns())

    def wall_offset_ns(self) -> int:
        """Returns the current offset in nanoseconds: the edge's wall clock minus this machine's wall clock.

        After a change of this machine's wall clock, the result is correct immediately.
        """
        now = time.monotonic_ns()
        return self.sync.offset_ns(now) + now - time.time_ns()

    def close(self) -> None:
        """Ends the thread and closes the connection."""
        self._closed.set()
        self._thread.join(2.0)

    def _run(self) -> None:
        while not self._closed.is_set():
            try:
                keys = self._endpoint.find_keys()
            except EnlivenError as error:
                # The viewer's main connection reports this error to the user.
                log.debug("clock probes to %s cannot start: %s", self._endpoint, error)
                self._closed.wait(1.0)
                continue
            self._probe(keys)

    def _probe(self, keys: ClientKeys | None) -> None:
        """Sends probes over one connection, until it is closed or does not answer."""
        context: zmq.Context[Any] = zmq.Context.instance()
        try:
            socket = make_socket(context, zmq.DEALER, _MAX_REPLY_BYTES, _MAX_UNREAD, keys)
        except zmq.ZMQError:
            self._closed.wait(1.0)
            return
        failed = self.sync.failed_bursts
        try:
            # Wait for the connection first. Otherwise the first probe would have a long round trip.
            socket.setsockopt(zmq.IMMEDIATE, 1)
            socket.connect(self._endpoint.control_address)
            while not self._closed.is_set() and self.sync.failed_bursts - failed < _MAX_FAILED_BURSTS:
                failed = min(failed, self.sync.failed_bursts)
                self._step(socket)
        except zmq.ZMQError as error:
            log.debug("clock probes to %s ended: %s", self._endpoint, error)
            self._closed.wait(1.0)
        finally:
            socket.close(linger=0)

    def _step(self, socket: zmq.Socket[bytes]) -> None:
        """Sends a probe that is due, and waits for an answer or for the next probe."""
        now = time.monotonic_ns()
        if self.sync.take_due_probe(now):
            self._send(socket)
        wait_ms = (self.sync.next_due_ns(now) - time.monotonic_ns()) // 1_000_000
        if not socket.poll(min(max(wait_ms, 0) + 1, _MAX_WAIT_MS)):
            return
        received_ns = time.monotonic_ns()
        parts = socket.recv_multipart(zmq.DONTWAIT)
        try:
            reply = unpack_control(b"".join(parts), REPLY)
        except MalformedMessageError:
            return
        sent_ns = self._sent.pop(reply.id, None)
        if sent_ns is not None and isinstance(reply.body, Pong):
            arrived_ns = reply.body.arrived_ns or reply.body.edge_ns
            self.sync.add(ClockExchange(sent_ns, arrived_ns, reply.body.edge_ns, received_ns))

    def _send(self, socket: zmq.Socket[bytes]) -> None:
        self._number += 1
        for old in [number for number in self._sent if number <= self._number - _MAX_UNREAD]:
            del self._sent[old]
        ping = Ping(self._name, time.time_ns(), listening=True, probe=True)
        data = pack_control(Request(self._number, ping))
        self._sent[self._number] = time.monotonic_ns()
        with contextlib.suppress(zmq.Again):
            socket.send(data, zmq.DONTWAIT)
