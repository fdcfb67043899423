"""Drivers of depth cameras on their real libraries, with a recording in place of the device.

Measured is what the edge pays beside the camera itself: from when an image is handed to the library to when
the edge has it, what is copied on the way, and how soon a camera is used again that was away.
"""

from __future__ import annotations

import importlib.util
import itertools
import os
import signal
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from figure import Figure

from enliven.arrays import UInt16
from enliven.camera import Intrinsics
from enliven.frames import DepthFrame
from enliven.recording import Recorder
from enliven_edge.sensors.base import Sensor, SensorFault
from enliven_edge.sensors.drivers.oak import OakSensor
from enliven_edge.sensors.drivers.orbbec import OrbbecSensor
from enliven_edge.sensors.drivers.realsense import RealSenseSensor
from enliven_edge.sensors.drivers.tof import TofSensor
from enliven_edge.sensors.isolation import IsolatedOpener
from enliven_edge.sensors.reopening import ReopeningSensor

WIDTH, HEIGHT, FPS = 640, 400, 30
FRAMES = 300
WARM = 30
"""Frames that are not measured: caches and threads find their places."""
AWAY = 2.0
"""Seconds that a camera is away."""
TIMES = 5
"""Losses and returns a driver."""


def _stamped(frame: DepthFrame, moment: int | None = None) -> DepthFrame:
    """The frame with a moment, monotonic nanoseconds, or this one, in its first four pixels."""
    depth = np.array(frame.depth)
    depth[0, :4] = np.array([moment or time.monotonic_ns()], np.int64).view(np.uint16)
    return replace(frame, depth=depth)


def _stamp(depth: UInt16) -> int:
    """The moment that an image bears."""
    return int(np.ascontiguousarray(depth[0, :4]).view(np.int64)[0])


class StampedRealSense(RealSenseSensor):
    """Images bear the moment when they are handed to the library."""

    def _send(self, frame: DepthFrame, number: int) -> None:
        super()._send(_stamped(frame), number)


class StampedOak(OakSensor):
    """Images bear the moment when they are handed to the library."""

    def _send(self, frame: DepthFrame, number: int) -> None:
        super()._send(_stamped(frame), number)


class StampedTof(TofSensor):
    """Images bear the moment when they are handed over in the library's place, as it measures them."""

    def _hand_over(self, measured: Any) -> None:
        measured.depth_data[0, :4] = np.array([time.monotonic_ns()], np.int64).view(np.uint16)
        super()._hand_over(measured)


class StampedOrbbec(OrbbecSensor):
    """Images bear the moment when the library hands them over: it takes them from a file itself."""

    def _received(self, image: Any) -> DepthFrame:
        handed = time.monotonic_ns()
        return _stamped(super()._received(image), handed)


DRIVERS: dict[str, tuple[str, Callable[..., Sensor], int]] = {
    "realsense": ("pyrealsense2", StampedRealSense, 0),
    "oak": ("depthai", StampedOak, 0),
    "orbbec": ("pyorbbecsdk", StampedOrbbec, 1),
    "tof": ("numpy", StampedTof, 0),
}
"""The library that each needs, the driver, and how often the library itself copies an image."""


def figures() -> Iterator[Figure]:
    """Overhead, copies and reconnecting of each driver whose library is installed."""
    with tempfile.TemporaryDirectory() as folder:
        take = Path(folder) / "take.mcap"
        _record(take)
        for name, (module, kind, more) in DRIVERS.items():
            if importlib.util.find_spec(module) is None:
                print(f"{name}: {module} is not installed")
                continue
            opener = IsolatedOpener(name, kind, {"rehearse": str(take)})
            milliseconds, copies = _overhead(opener)
            yield Figure(f"sensors.overhead_ms.{name}", statistics.median(milliseconds), "ms")
            yield Figure(f"sensors.overhead_ms_p99.{name}", float(np.percentile(milliseconds, 99)), "ms")
            yield Figure(f"sensors.copies.{name}", copies + more, "images copied an image")
            yield Figure(f"sensors.reconnect_ms.{name}", _reconnect(opener, take), "ms")


def _record(path: Path) -> None:
    """Images of noise on a wall, which no codec or cache makes easy."""
    camera = Intrinsics(WIDTH, HEIGHT, 441.25, 441.25, 319.5, 199.5)
    random = np.random.default_rng(0)
    with Recorder(path) as recorder:
        for number in range(FRAMES):
            depth = random.integers(2000, 2200, (HEIGHT, WIDTH)).astype(np.uint16)
            recorder.write_frame(DepthFrame(depth, camera, number * 1_000_000_000 // FPS, "bench"))


def _overhead(opener: IsolatedOpener) -> tuple[list[float], float]:
    """(milliseconds an image from the library's door to the edge's hands, images copied an image)."""
    taken, written = [], 0
    with opener() as sensor:
        while (frame := sensor.read(5.0)) is not None:
            taken.append(1e-6 * (time.monotonic_ns() - _stamp(frame.depth)))
            # What lies in shared memory was written once there; anything else was copied once more.
            written += 1 if _is_shared(frame.depth) else 2
    return taken[WARM:], written / len(taken)


def _is_shared(depth: UInt16) -> bool:
    """Whether an image lies in the helper's memory."""
    base = depth
    while isinstance(base.base, np.ndarray):
        base = base.base
    return base.base is not None


def _reconnect(opener: IsolatedOpener, take: Path) -> float:
    """Milliseconds at the median from when a lost camera is back to its first image."""
    import multiprocessing

    away, took = take.with_suffix(".away"), []
    with ReopeningSensor(opener) as sensor:
        for _ in range(TIMES):
            _next(sensor)
            take.rename(away)
            for process in multiprocessing.active_children():
                os.kill(process.pid or 0, signal.SIGKILL)
            until = time.monotonic() + AWAY
            while time.monotonic() < until:
                _attempt(sensor)
            away.rename(take)
            start = time.monotonic()
            _next(sensor)
            took.append(1e3 * (time.monotonic() - start))
    return statistics.median(took)


def _attempt(sensor: Sensor) -> DepthFrame | None:
    """A frame, where one comes."""
    try:
        frame = sensor.read(0.05)
    except (SensorFault, TimeoutError):
        return None
    return frame if isinstance(frame, DepthFrame) else None


def _next(sensor: Sensor) -> DepthFrame:
    """The next frame, over faults."""
    return next(frame for frame in map(_attempt, itertools.repeat(sensor)) if frame is not None)
