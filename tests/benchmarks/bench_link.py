"""Measures what the encryption of the link costs the edge, for one viewer.

Two edges track the same frames of one performer that possesses the chair, as in bench_road.py. One edge has
keys and the other has none. Each has a viewer in another process. They run alternately, frame by frame, so
both are measured under the same conditions.
"""

from __future__ import annotations

import contextlib
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from bench_road import Reel
from figure import Figure

from enliven.frames import DepthFrame
from enliven.keys.key_files import KeyPair, KeyStore
from enliven_edge.network.access import Access
from enliven_edge.network.outlet import Outlet
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.character_setup import create_actor
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker
from enliven_edge.warmup import warm_up_tracking
from enliven_synthesis.sensor.synthetic import SyntheticSensor

FRAMES, WARM = 270, 45
NODES = 128
LISTEN = """
import sys, zmq
socket = zmq.Context().socket(zmq.SUB)
if len(sys.argv) > 2:
    socket.curve_serverkey, socket.curve_publickey, socket.curve_secretkey = map(str.encode, sys.argv[2:])
socket.connect(sys.argv[1])
socket.setsockopt(zmq.SUBSCRIBE, b"")
while True:
    socket.recv()
"""
"""Program that receives the streams. Arguments: the address, the edge's public key, its own two keys."""


@dataclass
class Lap:
    """The seconds of each frame of one edge: the whole frame, and its network part."""

    edge: Edge
    frames: list[float] = field(default_factory=list)
    network: list[float] = field(default_factory=list)
    spent: float = 0.0

    def __post_init__(self) -> None:
        publish, publisher = self.edge.outlet.publish, self.edge.outlet.publisher
        self.edge.outlet.publish = self._timed(publish)  # type: ignore[method-assign]
        self._poll = self._timed(publisher.poll)

    def step(self, frame: DepthFrame) -> None:
        """Runs one frame."""
        self.spent, start = 0.0, time.perf_counter()
        self.edge.step(frame)
        self._poll()
        self.frames.append(time.perf_counter() - start)
        self.network.append(self.spent)

    def _timed(self, function):
        def timed(*arguments):
            start = time.perf_counter()
            result = function(*arguments)
            self.spent += time.perf_counter() - start
            return result

        return timed


def figures() -> Iterator[Figure]:
    """Yields link.curve_us and link.curve_cost."""
    with SyntheticSensor(width=640, realtime=False) as sensor:
        frames = [sensor.read() for _ in range(FRAMES)]
    warm_up_tracking()
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        store = KeyStore(Path(folder))
        keys = store.create_own_pair()
        plain = _lap(stack, "plain", None, None)
        locked = _lap(stack, "locked", Access("locked", keys, store), keys)
        for k, frame in enumerate(frames):
            for lap in (plain, locked) if k % 2 else (locked, plain):
                if k == WARM - 10:
                    lap.edge.stage.possess("chair")
                lap.step(frame)
    whole = statistics.median(plain.frames[WARM:])
    cost = statistics.median(b - a for a, b in zip(plain.network[WARM:], locked.network[WARM:], strict=True))
    yield Figure("link.curve_us", 1e6 * cost, "us per frame and viewer")
    yield Figure("link.curve_cost", 100 * cost / whole, "% of the edge's frame")


def _lap(stack: contextlib.ExitStack, name: str, access: Access | None, keys: KeyPair | None) -> Lap:
    """Returns an edge with a connected viewer."""
    from zmq.utils import z85

    actor = create_actor("chair", nodes=NODES)
    actor.warm_up()
    wire = WireSettings(name=f"bench-{name}", port=0, control_port=0)
    outlet = stack.enter_context(Outlet(wire, "reel", access=access))
    outlet.introduce(actor.character)
    words = [outlet.publisher.endpoint.stream_address]
    if keys is not None:
        words += [z85.encode(key).decode() for key in (keys.public, keys.public, keys.secret)]
    viewer = subprocess.Popen([sys.executable, "-c", LISTEN, *words])
    stack.callback(viewer.wait)
    stack.callback(viewer.kill)
    streams, deadline = outlet.publisher._streams, time.monotonic() + 30.0
    while not any(peer.state for peer in streams.server.connections):
        outlet.publisher.poll()
        assert time.monotonic() < deadline, "the viewer did not connect"
        time.sleep(0.01)
    return Lap(Edge(Reel([]), Tracker(), Stage([actor]), outlet))
