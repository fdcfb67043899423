"""Measures an edge under attack: its frame rate, its memory, and the response time for a well-behaved viewer.

``enliven edge`` runs in its shipped configuration on the shipped recording, looped and possessed. A viewer
listens and sends a request ten times per second: without an attack, under attack, and without an attack
again. The attack is a process that sends a million items in 40 s: endless valid requests, requests with PINGs
that end in a reset, subscriptions of 50 and 4,000 bytes, requests for characters that are never read, and
silent connections. Its rate is limited to 25,000 per second and its messages are packed beforehand, so that
it does not simply occupy the edge's processor. Items that the edge does not read also count, since they were
sent.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import zmq
from figure import Figure

from enliven.wire import requests
from enliven.wire.envelope import pack_control, unpack_stream
from enliven.wire.ports import free_ports

QUIET, ATTACK = 15.0, 40.0
"""Length of the parts without and with an attack, seconds."""
MESSAGES = 1_000_000
TICK = 0.02
"""Interval between two bursts of the attack, seconds."""
GIVEN_UP = 3.0
"""Time after which a request counts as never answered, seconds. It equals a viewer's own timeout."""
IDLE = 400
"""Number of idle connections that the attack holds open."""


def figures() -> Iterator[Figure]:
    """Yields frame rate, memory and response times under attack."""
    ports = free_ports()
    command = [sys.executable, "-m", "enliven", "edge", "--loop", "--possess-at", "1"]
    command += ["--port", str(ports[0]), "--control-port", str(ports[1]), "--name", f"hostile-{os.getpid()}"]
    edge = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    viewer = Viewer(ports)
    try:
        viewer.watch(5.0, wait=True)
        before = viewer.watch(QUIET)
        memory = _megabytes(edge)
        attack = subprocess.Popen([sys.executable, __file__, *map(str, ports)], stdout=subprocess.PIPE)
        most = memory
        under: list[tuple[int, float, list[float]]] = []
        while attack.poll() is None:
            under.append(viewer.watch(1.0))
            most = max(most, _megabytes(edge))
        print(f"attack: {attack.communicate()[0].decode().strip()}; edge: {edge.poll() or 'lives'}")
        after = viewer.watch(QUIET)
        most = max(most, _megabytes(edge))
    finally:
        edge.send_signal(signal.SIGTERM)
        edge.wait()
        viewer.close()
    calm = (before[0] + after[0]) / (before[1] + after[1])
    fps = sum(u[0] for u in under) / sum(u[1] for u in under)
    quiet = _time_slowest([before, after])
    slowest = _time_slowest(under)
    yield Figure("hostile.fps_under_flood", fps, "frames/s", "undisturbed", fps / calm if calm else None)
    yield Figure("hostile.rss_growth_mb", most - memory, "MB")
    yield Figure("hostile.command_ms_p99", slowest, "ms", "undisturbed", quiet / slowest)


class Viewer:
    """A well-behaved viewer that counts poses and sends a request ten times per second."""

    def __init__(self, ports: tuple[int, ...]) -> None:
        self.context = zmq.Context()
        self.stream, self.control = self.context.socket(zmq.SUB), self.context.socket(zmq.DEALER)
        self.stream.setsockopt(zmq.SUBSCRIBE, b"pose")
        for each, port in zip((self.stream, self.control), ports, strict=True):
            each.connect(f"tcp://127.0.0.1:{port}")

    def watch(self, seconds: float, wait: bool = False) -> tuple[int, float, list[float]]:
        """Returns (poses, seconds, milliseconds per request). With ``wait``, it first waits for a pose."""
        while wait and not self.stream.poll(1000):
            pass
        start = time.monotonic()
        poses, asked, due, times = 0, None, start, []
        while (now := time.monotonic()) < start + seconds or asked is not None:
            if asked is None and due <= now < start + seconds:
                self.control.send(pack_control(requests.Request(1, requests.Smooth(1_000, 1.0))))
                asked, due = now, now + 0.1
            if self.stream.poll(2):
                unpack_stream(self.stream.recv())
                poses += 1
            if self.control.poll(0):
                self.control.recv()
                if asked is not None:
                    times.append(1e3 * (time.monotonic() - asked))
                    asked = None
            elif asked is not None and now - asked > GIVEN_UP:
                times.append(1e3 * GIVEN_UP)
                asked = None
        return poses, time.monotonic() - start, times

    def close(self) -> None:
        self.context.destroy(linger=0)


def _time_slowest(parts: list[tuple[int, float, list[float]]]) -> float:
    """Returns the 99th percentile of the response times, milliseconds."""
    times = sorted(t for part in parts for t in part[2])
    return times[int(0.99 * (len(times) - 1))]


def _megabytes(process: subprocess.Popen[bytes]) -> float:
    """Returns the resident memory in megabytes, 0 for a process that has ended."""
    with contextlib.suppress(OSError, IndexError):
        status = Path(f"/proc/{process.pid}/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0]) / 1024
    return 0.0


def _frame(data: bytes, flags: int = 0) -> bytes:
    """Returns a ZMTP frame."""
    short = len(data) < 256
    return (bytes([flags, len(data)]) if short else struct.pack(">BQ", flags | 2, len(data))) + data


class Stranger:
    """A raw connection that sends its data repeatedly, and reconnects if it is closed."""

    greeting = b"\xff" + bytes(8) + b"\x7f\3\1" + b"NULL".ljust(20, b"\0") + bytes(32)

    def __init__(self, port: int, kind: bytes, data: bytes, count: int, reads: bool, resets: int = 0) -> None:
        about = b"\x05READY\x0bSocket-Type" + struct.pack(">I", len(kind)) + kind
        self.port, self.hello = port, self.greeting + _frame(about, 4)
        self.data, self.count, self.reads, self.resets = data, count, reads, resets
        self.socket: socket.socket | None = None
        self.rest, self.pushed = b"", 0

    def push(self) -> int:
        """Sends the data once more, as far as the socket accepts it. Returns the number of items sent."""
        try:
            if self.socket is None:
                self.socket = socket.create_connection(("127.0.0.1", self.port), timeout=1.0)
                self.socket.setblocking(False)
                self.rest = self.hello
            self.rest = self.rest or self.data
            sent = self.socket.send(self.rest)
            self.rest = self.rest[sent:]
            self.pushed += 1
            if self.reads:
                self.socket.recv(1 << 16)
            if self.resets and self.pushed % self.resets == 0:
                self.leave()
            return self.count * sent // len(self.data)
        except BlockingIOError:
            return 0
        except OSError:
            self.leave()
            return 0

    def leave(self) -> None:
        """Resets the connection."""
        if self.socket is not None:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            self.socket.close()
            self.socket = None


def connect_strangers(pose: int, control: int) -> list[Stranger]:
    """Returns the connections of the attack."""

    def ask(body: requests.Ask) -> bytes:
        return _frame(pack_control(requests.Request(7, body)))

    grab, join = requests.Possess("chair"), requests.Possess("chair", mode="join")
    look, release = requests.Look((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)), requests.Release("chair", 77)
    valid = b"".join(map(ask, (grab, join, release, look))) * 25
    pings = (ask(join) * 9 + _frame(b"\4PING\0\0", 4)) * 20
    short = b"".join(_frame(b"\x09SUBSCRIBE" + b"%040d" % i, 4) for i in range(100))
    long = b"".join(_frame(b"\x09SUBSCRIBE" + os.urandom(4000), 4) for _ in range(10))
    return [
        *[Stranger(control, b"DEALER", valid, 100, reads=True) for _ in range(2)],
        Stranger(control, b"DEALER", pings, 200, reads=False, resets=40),
        Stranger(control, b"DEALER", _frame(bytes(4000)) * 10, 10, reads=False),
        Stranger(control, b"DEALER", ask(requests.GetState("chair")) * 100, 100, reads=False),
        Stranger(pose, b"SUB", short, 100, reads=False, resets=50),
        Stranger(pose, b"SUB", long, 10, reads=False),
    ]


def attack(pose: int, control: int) -> None:
    """Sends a million items within the time limit, or as many as the edge accepts."""
    strangers, idle, sent, knocks = connect_strangers(pose, control), [], 0, 0
    start, turns = time.monotonic(), itertools.count()
    while sent < MESSAGES and time.monotonic() < start + 2 * ATTACK:
        if sent > MESSAGES * (time.monotonic() - start) / ATTACK:
            time.sleep(TICK)
            continue
        turn = next(turns)
        pushed = sum(each.push() for each in strangers)
        sent += pushed
        if turn % 4 == 0:
            knock = socket.socket()
            knock.setblocking(False)
            knock.connect_ex(("127.0.0.1", (pose, control)[knocks % 2]))
            idle.append(knock)
            sent, knocks = sent + 1, knocks + 1
        if len(idle) > IDLE:
            idle.pop(0).close()
        if not pushed:
            # These connections accept no more data, so they are replaced.
            for each in strangers[2:]:
                each.leave()
            time.sleep(TICK)
    print(f"{sent} sent in {time.monotonic() - start:.0f} s, {knocks} of them idle connections")


if __name__ == "__main__":
    attack(int(sys.argv[1]), int(sys.argv[2]))
