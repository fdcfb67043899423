"""Tests of a flood of connections from one address: served viewers keep working, and new viewers get in."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Iterator

import pytest
import zmq
from patience import TIMEOUT_S
from zmq_contexts import make_context

from enliven.wire import requests, topics
from enliven.wire.envelope import pack_control, unpack_control
from enliven.wire.zmtp import GREETING, make_frame
from enliven_edge.network.connection import Connection
from enliven_edge.network.control_socket import Command, ControlSocket
from enliven_edge.network.server import ZmtpServer

PLACES, CROWD = 20, 200
"""Connection limit of the server, and number of connections that compete for it."""
READY = make_frame(b"\x05READY\x0bSocket-Type" + struct.pack(">I", 6) + b"DEALER", 4)
PING = make_frame(pack_control(requests.Request(1, requests.Ping("rude", 1))))
ORDER = make_frame(pack_control(requests.Request(1, requests.Possess("chair", mode="join"))))


class Edge:
    """An edge's control port with few connections."""

    def __init__(self) -> None:
        max_bytes = topics.REQUEST.max_bytes + 64
        self.server = ZmtpServer("127.0.0.1", 0, "--control-port", "ROUTER", max_bytes, PLACES)
        self._control = ControlSocket(self.server, self._answer, lambda kind, peer: "", 100.0, 0.002)

    def _answer(self, request: requests.Ask, peer: Connection) -> requests.Answer:
        assert isinstance(request, requests.Ping)
        return requests.Pong(request.sent_ns, time.time_ns(), peer.arrived_ns)

    def poll(self) -> list[Command]:
        """Answers requests. Returns the orders."""
        return self._control.poll()


@pytest.fixture
def edge() -> Iterator[Edge]:
    opened = Edge()
    yield opened
    opened.server.close()


class Crowd:
    """Local connections that reconnect immediately after they are closed."""

    def __init__(self, edge: Edge, first: bytes, again: bytes) -> None:
        self.address = ("127.0.0.1", edge.server.port)
        self.first, self.again = first, again
        self.sockets = [self._new() for _ in range(CROWD)]
        self.asked = time.monotonic()

    def push(self) -> None:
        due = time.monotonic() - self.asked > 0.5
        self.asked = time.monotonic() if due else self.asked
        for number, (own, left) in enumerate(self.sockets):
            try:
                left = left or (self.again if due else b"")
                sent = own.send(left) if left else 0
                self.sockets[number] = own, left[sent:]
                if own.recv(65_536) == b"":
                    raise ConnectionError
            except BlockingIOError:
                continue
            except OSError:
                own.close()
                self.sockets[number] = self._new()

    def _new(self) -> tuple[socket.socket, bytes]:
        own = socket.socket()
        own.setblocking(False)
        own.connect_ex(self.address)
        return own, self.first

    def close(self) -> None:
        for own, _ in self.sockets:
            own.close()


class Studio:
    """A viewer made of raw sockets that sends requests repeatedly."""

    def __init__(self, edge: Edge) -> None:
        self.context = make_context()
        self.socket = self.context.socket(zmq.DEALER)
        self.socket.setsockopt(zmq.LINGER, 0)
        self.socket.setsockopt(zmq.RECONNECT_IVL, 50)
        self.socket.connect(f"tcp://127.0.0.1:{edge.server.port}")
        self.asked, self.answered, self.due = 0, 0, 0.0

    def ask(self) -> None:
        if time.monotonic() > self.due:
            self.due = time.monotonic() + 0.1
            self.asked += 1
            self.socket.send(pack_control(requests.Request(self.asked, requests.Ping("studio", 1))))
        while self.socket.poll(0):
            unpack_control(self.socket.recv(), topics.REPLY)
            self.answered += 1

    def close(self) -> None:
        self.context.destroy(linger=0)


@pytest.mark.parametrize(
    ("first", "again"),
    [(b"", b""), (GREETING + READY, b""), (GREETING + READY + PING, b""), (GREETING + READY + PING, PING),
     (GREETING + READY + ORDER, ORDER)],
    ids=["silent", "greeting", "once", "again", "orders"],
)  # fmt: skip
@pytest.mark.slow
def test_a_crowd_of_the_same_address_does_not_mute_a_studio(edge: Edge, first: bytes, again: bytes) -> None:
    studio = Studio(edge)
    start = time.monotonic()
    while time.monotonic() < start + 1.3 or studio.answered < 5:
        assert time.monotonic() < start + TIMEOUT_S
        edge.poll()
        studio.ask()
    (own,) = edge.server.connections
    crowd = Crowd(edge, first, again)
    new, before, start = Studio(edge), studio.answered, time.monotonic()
    try:
        # A new viewer competes with many connections for half of the slots. It gets one after some seconds.
        waits = PING not in first and not again
        while time.monotonic() < start + 1.5 or (waits and new.answered < 3):
            assert time.monotonic() < start + TIMEOUT_S, f"{new.answered} of {new.asked} answers"
            crowd.push()
            for command in edge.poll():
                command.reply(requests.Done())
            studio.ask()
            new.ask()
            time.sleep(0.001)
        assert own.is_open, "it has the same connection as before"
        assert studio.answered - before >= 5 and studio.asked - studio.answered <= 5
        assert len(list(edge.server.connections)) <= PLACES
    finally:
        crowd.close()
        new.close()
        studio.close()
