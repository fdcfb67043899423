"""Measures what 1, 10 and 100 viewers cost an edge, directly and through a relay, and the clock alignment.

The edge tracks a performer that possesses the chair, as in bench_link.py. The cost is the additional
processor time that a frame spends in the network because of the viewers. As a fraction of the frame's time,
it is the loss of frame rate of a busy edge. Only the edge's thread is measured, because the viewers share the
processors here but usually run on other machines. Frames come at 30 per second, and viewers ping once per
second. An edge without viewers runs alternately with it, frame by frame, so both are measured under the same
conditions.
"""

from __future__ import annotations

import contextlib
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

from bench_link import NODES
from bench_road import Reel
from figure import Figure

from enliven.frames import DepthFrame
from enliven.peers.clock_probe import ClockProbe
from enliven.wire import free_ports
from enliven_edge.network.outlet import Outlet
from enliven_edge.network.publisher import Publisher
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.character_setup import create_actor
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker
from enliven_edge.warmup import warm_up_tracking
from enliven_synthesis.sensor.synthetic import SyntheticSensor

FRAMES, WARM = 225, 75
RATE_HZ = 30.0
COUNTS = (1, 10, 100)
SETTLING_S = 3.0
"""Seconds until all viewers of a relay are connected."""
MANY = 1000
"""Number of viewers for which the cost is extrapolated."""
CLOCK_S = 30.0
"""Duration of the measurement of the clock in seconds."""
VIEWERS = """
import sys, time, zmq
from enliven.wire import Endpoint, Ping, Request, pack_control
context = zmq.Context()
streams, controls = [], []
for _ in range(int(sys.argv[3])):
    stream, control = context.socket(zmq.SUB), context.socket(zmq.DEALER)
    stream.connect("tcp://127.0.0.1:" + sys.argv[1])
    stream.setsockopt(zmq.SUBSCRIBE, b"")
    control.connect("tcp://127.0.0.1:" + sys.argv[2])
    streams.append(stream)
    controls.append(control)
poller = zmq.Poller()
for socket in (*streams, *controls):
    poller.register(socket, zmq.POLLIN)
turn, asked = 0, time.monotonic()
while True:
    for socket, _ in poller.poll(20):
        socket.recv()
    # Each viewer pings once a second, as windows do.
    while time.monotonic() > asked:
        controls[turn % len(controls)].send(pack_control(Request(turn + 1, Ping("v", 0, True))))
        turn, asked = turn + 1, asked + 1 / len(controls)
"""
"""Program of all viewers. Arguments: the two ports and the number of viewers."""
RELAY = """
import sys
from enliven_edge.commands.relay import relay
relay(sys.argv[1], port=int(sys.argv[2]), control_port=int(sys.argv[3]))
"""
"""Program of the relay. Arguments: the edge's address and its own two ports."""


def figures() -> Iterator[Figure]:
    """Yields link.viewers_N_cost and link.viewers_N_relay_cost, and link.clock_us."""
    with SyntheticSensor(width=640, realtime=False) as sensor:
        frames = [sensor.read() for _ in range(FRAMES)]
    warm_up_tracking()
    for word, through_relay in (("", False), ("_relay", True)):
        costs = {count: _cost(frames, count, through_relay=through_relay) for count in COUNTS}
        for count, cost in costs.items():
            yield Figure(f"link.viewers_{count}{word}_cost", cost, "% of the edge's frame rate")
        slope = (costs[COUNTS[-1]] - costs[COUNTS[0]]) / (COUNTS[-1] - COUNTS[0])
        many = costs[COUNTS[0]] + slope * (MANY - COUNTS[0])
        way = "through a relay" if through_relay else "directly"
        print(f"note: {MANY} viewers {way} would cost {many:.1f} %, calculated from the slope")
    yield Figure("link.clock_us", _clock_error_us(), "us, worst of 30 s")


@dataclass
class Lap:
    """An edge with its processor time in the network and in the whole frame, seconds for each frame."""

    edge: Edge
    network: list[float] = field(default_factory=list)
    frames: list[float] = field(default_factory=list)
    timer: _Timer = field(default_factory=lambda: _Timer())

    def __post_init__(self) -> None:
        outlet = self.edge.outlet
        outlet.publish = self.timer.timed(outlet.publish)  # type: ignore[method-assign]
        self._poll = self.timer.timed(outlet.publisher.poll)

    def step(self, frame: DepthFrame) -> None:
        """Runs one frame."""
        self.timer.spent, begun = 0.0, time.thread_time()
        self.edge.step(frame)
        self._poll()
        self.frames.append(time.thread_time() - begun)
        self.network.append(self.timer.spent)


def _cost(frames: list[DepthFrame], viewers: int, *, through_relay: bool) -> float:
    """Returns the cost of viewers as a percentage of the frame rate."""
    with contextlib.ExitStack() as stack:
        lone = _lap(stack, "lone")
        lap = _lap(stack, "followed")
        outlet = lap.edge.outlet
        endpoint = outlet.publisher.endpoint
        ports, expected = (endpoint.pose_port, endpoint.control_port), viewers
        if through_relay:
            ports, expected = free_ports()[:2], 1
            _start(stack, "-c", RELAY, str(endpoint), str(ports[0]), str(ports[1]))
        _start(stack, "-c", VIEWERS, str(ports[0]), str(ports[1]), str(viewers))
        deadline = time.monotonic() + 60.0
        while outlet.publisher.viewers < expected:
            outlet.publisher.poll()
            assert time.monotonic() < deadline, "the viewers did not connect"
            time.sleep(0.005)
        settled = time.monotonic() + SETTLING_S
        while time.monotonic() < settled:
            outlet.publisher.poll()
            time.sleep(0.005)
        start = time.monotonic()
        for k, frame in enumerate(frames):
            for each in (lone, lap) if k % 2 else (lap, lone):
                if k == WARM - 10:
                    each.edge.stage.possess("chair")
                each.step(frame)
            time.sleep(max(start + (k + 1) / RATE_HZ - time.monotonic(), 0.0))
    extra = statistics.median(b - a for a, b in zip(lone.network[WARM:], lap.network[WARM:], strict=True))
    return 100 * extra / statistics.median(lone.frames[WARM:])


def _lap(stack: contextlib.ExitStack, name: str) -> Lap:
    """Returns an edge with a chair."""
    actor = create_actor("chair", nodes=NODES)
    actor.warm_up()
    wire = WireSettings(name=f"bench-{name}", port=0, control_port=0)
    outlet = stack.enter_context(Outlet(wire, "reel"))
    outlet.introduce(actor.character)
    return Lap(Edge(Reel([]), Tracker(), Stage([actor]), outlet))


class _Timer:
    """Sums this thread's processor time in some functions, seconds."""

    def __init__(self) -> None:
        self.spent = 0.0

    def timed(self, function):
        def timed(*arguments):
            begun = time.thread_time()
            result = function(*arguments)
            self.spent += time.thread_time() - begun
            return result

        return timed


def _start(stack: contextlib.ExitStack, *words: str) -> None:
    process = subprocess.Popen([sys.executable, *words])
    stack.callback(process.wait)
    stack.callback(process.kill)


def _clock_error_us() -> float:
    """Returns the largest error of the aligned clock in microseconds.

    The edge runs at 30 frames per second in another thread. Both sides use the clock of this machine.
    """
    stop = threading.Event()
    with Publisher(name="bench-clock", pose_port=0, control_port=0) as publisher:

        def poll() -> None:
            while not stop.is_set():
                publisher.poll()
                time.sleep(1 / 30)

        thread = threading.Thread(target=poll)
        thread.start()
        probe, errors = ClockProbe(publisher.endpoint, "bench"), []
        end = time.monotonic() + CLOCK_S
        while time.monotonic() < end:
            time.sleep(0.05)
            if probe.is_known:
                errors.append(abs(probe.offset_ns() - (time.time_ns() - time.monotonic_ns())) / 1e3)
        probe.close()
        stop.set()
        thread.join()
    return max(errors)
