"""Measures the whole path through the edge: from reading a depth frame to publishing the pose.

One performer at 640 x 480 (the Kinect v1 profile's noise) possesses the chair with 128 nodes. Poses, bodies
and cues are sent through real sockets to a subscriber in another process.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from figure import Figure

from enliven.frames import DepthFrame
from enliven.wire.streams import PoseMessage
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import Sensor
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
socket.connect(sys.argv[1])
socket.setsockopt(zmq.SUBSCRIBE, b"")
while True:
    socket.recv()
"""


class Reel(Sensor):
    """A sensor that returns frames from memory, so that rendering costs the edge no time."""

    name = "reel"

    def __init__(self, frames: list[DepthFrame]) -> None:
        self._frames = iter(frames)

    def read(self, timeout: float | None = None) -> DepthFrame | None:
        return next(self._frames, None)

    def close(self) -> None:
        self._frames = iter(())


def figures() -> Iterator[Figure]:
    """Yields latency, throughput and message size of the path."""
    with SyntheticSensor(width=640, realtime=False) as sensor:
        frames = [sensor.read() for _ in range(FRAMES)]
    actor = create_actor("chair", nodes=NODES)
    actor.warm_up()
    warm_up_tracking()
    with Outlet(WireSettings(name="bench", port=0, control_port=0), "reel") as outlet:
        outlet.introduce(actor.character)
        address = outlet.publisher.endpoint.stream_address
        listener = subprocess.Popen([sys.executable, "-c", LISTEN, address])
        try:
            edge = Edge(Reel(frames), Tracker(), Stage([actor]), outlet)
            latencies, seconds, sizes = _perform_road(edge, frames)
        finally:
            listener.kill()
            listener.wait()
    raw, size = NODES * 12 * 4, float(np.mean(sizes))
    yield Figure("road.latency_p50_ms", float(np.percentile(latencies, 50)), "ms")
    yield Figure("road.latency_p99_ms", float(np.percentile(latencies, 99)), "ms")
    yield Figure("road.fps", len(latencies) / seconds, "frames/s")
    yield Figure("road.pose_bytes", size, "bytes", "raw float32 3x4", raw / size)


def _perform_road(edge: Edge, frames: list[DepthFrame]) -> tuple[list[float], float, list[int]]:
    """Returns (milliseconds per frame, total seconds, bytes per pose message) after the performer is
    attached."""
    sizes: list[int] = []
    publish = edge.outlet.publisher.publish

    def weighed(message: Any) -> int:
        size = publish(message)
        if isinstance(message, PoseMessage):
            sizes.append(size)
        return size

    edge.outlet.publisher.publish = weighed
    latencies, begin = [], 0.0
    for i, frame in enumerate(frames):
        if i == WARM - 10:
            edge.stage.possess("chair")
        if i == WARM:
            begin = time.perf_counter()
            sizes.clear()
        start = time.perf_counter()
        edge.step(frame)
        if i >= WARM:
            latencies.append(1e3 * (time.perf_counter() - start))
        edge.poll_requests()
    return latencies, time.perf_counter() - begin, sizes
