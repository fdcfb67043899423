"""Tests that an edge survives network attacks by unknown clients, with bounded memory growth."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import struct
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest
import zmq
from zmq_contexts import make_context

from enliven.wire import requests, topics
from enliven.wire.envelope import pack_control, unpack_control, unpack_stream
from enliven.wire.zmtp import GREETING, make_frame

PATIENCE = 60.0
"""Timeout of a test in seconds, long enough for a loaded machine."""
ATTACK = 2.0
"""Duration of an attack in seconds."""
MOST_GROWTH_MB = 30.0
"""Maximum growth of the edge's memory by one attack, megabytes. Without limits, each took 100 to 1,400."""
PING = make_frame(b"\x04PING\0\0", 4)

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(sys.platform != "linux", reason="memory and descriptors are read from /proc"),
]


class RunningEdge:
    """The program of strange_edge.py and its externally visible state."""

    def __init__(self, descriptors: int | None = None) -> None:
        script = Path(__file__).with_name("strange_edge.py")
        limit = f"ulimit -n {descriptors}; " if descriptors else ""
        command = f'{limit}exec "{sys.executable}" "{script}" test-{uuid.uuid4().hex[:10]}'
        self.process = subprocess.Popen(["sh", "-c", command], stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.pose_port, self.control_port = (int(p) for p in self.process.stdout.readline().split())
        self.hear_bodies(5)
        self.memory = self.megabytes()

    def megabytes(self) -> float:
        """Returns the resident memory of the edge in megabytes."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0]) / 1024

    @property
    def grown(self) -> float:
        """Returns the memory growth since the start, megabytes."""
        return self.megabytes() - self.memory

    def hear_bodies(self, count: int) -> None:
        """Waits until a new viewer has received ``count`` body messages."""
        with make_context() as context, context.socket(zmq.SUB) as viewer:
            viewer.setsockopt(zmq.LINGER, 0)
            viewer.setsockopt(zmq.SUBSCRIBE, b"bodies")
            viewer.connect(f"tcp://127.0.0.1:{self.pose_port}")
            deadline = time.monotonic() + PATIENCE
            while count:
                assert self.process.poll() is None, f"the edge ended with {self.process.returncode}"
                assert time.monotonic() < deadline, "no bodies come"
                if viewer.poll(100):
                    assert unpack_stream(viewer.recv())[0] is topics.BODIES
                    count -= 1

    def answer(self) -> None:
        """Sends a request as a new viewer and waits for the answer."""
        with make_context() as context, context.socket(zmq.DEALER) as viewer:
            viewer.setsockopt(zmq.LINGER, 0)
            viewer.connect(f"tcp://127.0.0.1:{self.control_port}")
            viewer.send(pack_control(requests.Request(1, requests.Ping("good", 5))))
            deadline = time.monotonic() + PATIENCE
            while not viewer.poll(100):
                assert self.process.poll() is None, f"the edge ended with {self.process.returncode}"
                assert time.monotonic() < deadline, "no answer comes"
            assert isinstance(unpack_control(viewer.recv(), topics.REPLY).body, requests.Pong)

    def goes_on(self) -> None:
        """Checks that the edge serves new viewers beyond the end of the recording, after the loop has
        restarted.
        """
        self.answer()
        self.hear_bodies(40)

    def close(self) -> int:
        """Asks the edge to end and returns its exit status."""
        self.process.send_signal(signal.SIGTERM)
        try:
            return self.process.wait(PATIENCE)
        finally:
            self.process.kill()
            self.process.wait()


@pytest.fixture(scope="module")
def running() -> Iterator[list[RunningEdge]]:
    """Returns the edge that all attacks share. Restarts it if an attack ended it."""
    edges: list[RunningEdge] = []
    yield edges
    for each in edges:
        each.close()


@pytest.fixture
def edge(running: list[RunningEdge]) -> RunningEdge:
    if not running or running[-1].process.poll() is not None:
        running.append(RunningEdge())
    running[-1].memory = running[-1].megabytes()
    return running[-1]


def connected(port: int, kind: str) -> socket.socket:
    """Opens a raw TCP connection that has introduced itself as a DEALER or SUB socket."""
    opened = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
    about = b"\x0bSocket-Type" + struct.pack(">I", len(kind)) + kind.encode()
    opened.sendall(GREETING + make_frame(b"\x05READY" + about, 4))
    received = b""
    while len(received) < 66 or len(received) < 66 + received[65]:
        received += opened.recv(200)
    opened.setblocking(False)
    return opened


def pushed(connections: list[socket.socket], data: bytes, seconds: float = ATTACK) -> int:
    """Sends the same bytes repeatedly on each connection as fast as possible. Returns the number of bytes
    sent.
    """
    deadline, sent = time.monotonic() + seconds, 0
    rest = dict.fromkeys(connections, data)
    while time.monotonic() < deadline and rest:
        for each in list(rest):
            try:
                count = each.send(rest[each])
                sent += count
                rest[each] = rest[each][count:] or data
            except BlockingIOError:
                time.sleep(0.001)
            except OSError:
                del rest[each]
    return sent


def reset(connection: socket.socket) -> None:
    """Resets a connection (RST) instead of closing it."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    connection.close()


def request(body: requests.Ask) -> bytes:
    """Returns a request in its wire format."""
    return make_frame(pack_control(requests.Request(1, body)))


@pytest.mark.slow
def test_a_viewer_that_floods_and_leaves_does_not_end_the_edge(edge: RunningEdge) -> None:
    """Tens of thousands of requests are queued by a libzmq socket, which then closes."""
    context = make_context()
    dealer = context.socket(zmq.DEALER)
    dealer.connect(f"tcp://127.0.0.1:{edge.control_port}")
    order = pack_control(requests.Request(1, requests.Possess("statue")))
    deadline = time.monotonic() + ATTACK
    while time.monotonic() < deadline:
        with contextlib.suppress(zmq.Again):
            dealer.send(order, zmq.DONTWAIT)
    context.destroy(linger=0)
    time.sleep(2.5)
    edge.goes_on()


@pytest.mark.parametrize(
    ("port", "kind", "message"),
    [
        ("control_port", "DEALER", request(requests.Possess("statue"))),
        ("pose_port", "SUB", make_frame(b"\x09SUBSCRIBEpose", 4)),
    ],
)
def test_pings_among_a_flood_that_is_reset_do_not_end_the_edge(
    edge: RunningEdge, port: str, kind: str, message: bytes
) -> None:
    for _ in range(5):
        rude = connected(getattr(edge, port), kind)
        pushed([rude], (message * 20 + PING) * 100, 0.3)
        reset(rude)
    edge.goes_on()


@pytest.mark.slow
def test_long_subscriptions_take_no_memory_and_stop_no_stream(edge: RunningEdge) -> None:
    rude = connected(edge.pose_port, "SUB")
    noise = os.urandom(2000 * 4000)
    data = b"".join(make_frame(b"\x09SUBSCRIBE" + noise[i * 4000 : (i + 1) * 4000], 4) for i in range(2000))
    pushed([rude], data)
    edge.goes_on()
    assert edge.grown < MOST_GROWTH_MB
    reset(rude)


@pytest.mark.slow
def test_idle_connections_neither_end_a_loop_nor_keep_others_out() -> None:
    """Opens more connections than the edge may have descriptors, half of them to each port."""
    edge, idle = RunningEdge(descriptors=256), []
    try:
        for number in range(1100):
            port = (edge.pose_port, edge.control_port)[number % 2]
            connection = socket.socket()
            connection.setblocking(False)
            connection.connect_ex(("127.0.0.1", port))
            idle.append(connection)
            time.sleep(0.001)
        edge.goes_on()
        assert edge.process.poll() is None
    finally:
        for connection in idle:
            connection.close()
        ended = edge.close()
    assert ended == 0


@pytest.mark.slow
def test_long_requests_that_pile_up_take_no_memory(edge: RunningEdge) -> None:
    rude = [connected(edge.control_port, "DEALER") for _ in range(20)]
    sent = pushed(rude, make_frame(bytes(4000)) * 16)
    grown = edge.grown
    edge.goes_on()
    assert sent > 20_000_000, "the attack was one"
    assert grown < MOST_GROWTH_MB
    for each in rude:
        reset(each)


@pytest.mark.slow
def test_unread_characters_take_no_memory(edge: RunningEdge) -> None:
    rude = [connected(edge.control_port, "DEALER") for _ in range(3)]
    pushed(rude, request(requests.GetState("statue")) * 100, 0.5)
    deadline = time.monotonic() + ATTACK
    while time.monotonic() < deadline and edge.grown < MOST_GROWTH_MB:
        time.sleep(0.1)
    assert edge.grown < MOST_GROWTH_MB
    edge.goes_on()
    for each in rude:
        reset(each)
