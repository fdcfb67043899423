"""Measures drivers of depth cameras with their real libraries, and a recording in place of the device.

It measures the edge's overhead in addition to the camera itself: the time from passing an image to the
library until the edge has it, the copies made meanwhile, and the time until a reconnected camera delivers
again.
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
from enliven_edge.sensors.isolation.isolated import IsolatedOpener
from enliven_edge.sensors.reopening import ReopeningSensor

WIDTH, HEIGHT, FPS = 640, 400, 30
FRAMES = 300
WARM = 30
"""Number of frames before the measurement, during which caches and threads warm up."""
AWAY = 2.0
"""Time for which a camera is disconnected, seconds."""
TIMES = 5
"""Number of disconnections per driver."""


def _write_stamp(frame: DepthFrame, moment: int | None = None) -> DepthFrame:
    """Returns the frame with a timestamp, monotonic nanoseconds (now by default), in its first four
    pixels."""
    depth = np.array(frame.depth)
    depth[0, :4] = np.array([moment or time.monotonic_ns()], np.int64).view(np.uint16)
    return replace(frame, depth=depth)


def _read_stamp(depth: UInt16) -> int:
    """Returns the timestamp stored in an image."""
    return int(np.ascontiguousarray(depth[0, :4]).view(np.int64)[0])


class StampedRealSense(RealSenseSensor):
    """A driver whose images contain the time at which they were passed to the library."""

    def _send(self, frame: DepthFrame, number: int) -> None:
        super()._send(_write_stamp(frame), number)


class StampedOak(OakSensor):
    """A driver whose images contain the time at which they were passed to the library."""

    def _send(self, frame: DepthFrame, number: int) -> None:
        super()._send(_write_stamp(frame), number)


class StampedTof(TofSensor):
    """A driver whose images contain the time of their transfer, in place of the library's measuring time."""

    def _queue_frame(self, measured: Any) -> None:
        measured.depth_data[0, :4] = np.array([time.monotonic_ns()], np.int64).view(np.uint16)
        super()._queue_frame(measured)


class StampedOrbbec(OrbbecSensor):
    """A driver whose images contain the time of delivery by the library, which itself reads the file."""

    def _convert_frame(self, image: Any) -> DepthFrame:
        handed = time.monotonic_ns()
        return _write_stamp(super()._convert_frame(image), handed)


DRIVERS: dict[str, tuple[str, Callable[..., Sensor], int]] = {
    "realsense": ("pyrealsense2", StampedRealSense, 0),
    "oak": ("depthai", StampedOak, 0),
    "orbbec": ("pyorbbecsdk", StampedOrbbec, 1),
    "tof": ("numpy", StampedTof, 0),
}
"""The library that each driver needs, the driver, and the number of copies of an image that the library
makes.
"""


def figures() -> Iterator[Figure]:
    """Yields overhead, copies and reconnection time of each driver with an installed library."""
    with tempfile.TemporaryDirectory() as folder:
        take = Path(folder) / "take.mcap"
        _record(take)
        for name, (module, kind, more) in DRIVERS.items():
            if importlib.util.find_spec(module) is None:
                print(f"{name}: {module} is not installed")
                continue
            opener = IsolatedOpener(name, kind, {"rehearse": str(take)})
            milliseconds, copies = _measure_overhead(opener)
            yield Figure(f"sensors.overhead_ms.{name}", statistics.median(milliseconds), "ms")
            yield Figure(f"sensors.overhead_ms_p99.{name}", float(np.percentile(milliseconds, 99)), "ms")
            yield Figure(f"sensors.copies.{name}", copies + more, "images copied an image")
            yield Figure(f"sensors.reconnect_ms.{name}", _reconnect(opener, take), "ms")


def _record(path: Path) -> None:
    """Records images of noise on a wall, which no codec or cache can compress well."""
    camera = Intrinsics(WIDTH, HEIGHT, 441.25, 441.25, 319.5, 199.5)
    random = np.random.default_rng(0)
    with Recorder(path) as recorder:
        for number in range(FRAMES):
            depth = random.integers(2000, 2200, (HEIGHT, WIDTH)).astype(np.uint16)
            recorder.write_frame(DepthFrame(depth, camera, number * 1_000_000_000 // FPS, "bench"))


def _measure_overhead(opener: IsolatedOpener) -> tuple[list[float], float]:
    """Returns (milliseconds per image from the library to the edge, copies per image)."""
    taken, written = [], 0
    with opener() as sensor:
        while (frame := sensor.read(5.0)) is not None:
            taken.append(1e-6 * (time.monotonic_ns() - _read_stamp(frame.depth)))
            # Data in shared memory was written there once. Any other data was copied once more.
            written += 1 if _is_shared(frame.depth) else 2
    return taken[WARM:], written / len(taken)


def _is_shared(depth: UInt16) -> bool:
    """Returns True if an image is in the helper process' shared memory."""
    base = depth
    while isinstance(base.base, np.ndarray):
        base = base.base
    return base.base is not None


def _reconnect(opener: IsolatedOpener, take: Path) -> float:
    """Returns the median milliseconds from the return of a lost camera to its first image."""
    import multiprocessing

    away, took = take.with_suffix(".away"), []
    with ReopeningSensor(opener) as sensor:
        for _ in range(TIMES):
            _read_next(sensor)
            take.rename(away)
            for process in multiprocessing.active_children():
                os.kill(process.pid or 0, signal.SIGKILL)
            until = time.monotonic() + AWAY
            while time.monotonic() < until:
                _try_next(sensor)
            away.rename(take)
            start = time.monotonic()
            _read_next(sensor)
            took.append(1e3 * (time.monotonic() - start))
    return statistics.median(took)


def _try_next(sensor: Sensor) -> DepthFrame | None:
    """Returns the next frame, or None if none arrives."""
    try:
        frame = sensor.read(0.05)
    except (SensorFault, TimeoutError):
        return None
    return frame if isinstance(frame, DepthFrame) else None


def _read_next(sensor: Sensor) -> DepthFrame:
    """Returns the next frame, ignoring faults."""
    return next(frame for frame in map(_try_next, itertools.repeat(sensor)) if frame is not None)
