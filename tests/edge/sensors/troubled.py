"""A third-party driver that opens, reads and closes, and can have every fault of a camera."""

from __future__ import annotations

import threading
import time
from typing import ClassVar

import numpy as np

from enliven.camera import Intrinsics
from enliven.frames import DepthFrame
from enliven_edge.sensors.base import Sensor

STEP = 33_333_333
FAULTS = (
    "OSError",
    "RuntimeError",
    "another size",
    "focal length nan",
    "focal length zero",
    "wrong type",
    "wrong shape",
    "negative time",
    "endless time",
    "no frame",
)


def picture(number: int, width: int = 64, height: int = 48) -> np.ndarray:
    """Returns a (height, width) uint16 depth image of a wall in millimetres. It differs for each number."""
    noise = np.random.default_rng(number).integers(0, 20, (height, width))
    return (2500 + noise).astype(np.uint16)


def camera(width: int = 64, height: int = 48, focal: float = 60.0) -> Intrinsics:
    return Intrinsics(width, height, focal, focal, width / 2 - 0.5, height / 2 - 0.5)


class Troubled(Sensor):
    """Delivers frames 0 to ``frames`` - 1. Before each number in ``faults``, its fault occurs once.

    Each device counts time from 0, as after being plugged in again. Frame numbers continue across devices.
    """

    name = "troubled"
    fps = 30.0
    devices: ClassVar[list[Troubled]] = []
    number = 0
    done: ClassVar[set[int]] = set()

    def __init__(self, frames: int = 60, faults: str = "", every: int = 5, pace: float = 0.0) -> None:
        self.frames, self.pace = frames, pace
        self.faults = {(i + 1) * every: f for i, f in enumerate(f for f in faults.split(",") if f)}
        self.closed = False
        self._own = 0
        Troubled.devices.append(self)

    @classmethod
    def reset(cls) -> None:
        """Resets the class to its initial state, before the first device."""
        cls.devices, cls.number, cls.done = [], 0, set()

    def read(self, timeout: float | None = None) -> DepthFrame | None:
        """Returns the next frame, or raises the next fault."""
        time.sleep(self.pace)
        at = Troubled.number
        if at in self.faults and at not in Troubled.done:
            Troubled.done.add(at)
            return self._fault(self.faults[at])
        if at >= self.frames:
            return None
        Troubled.number += 1
        self._own += 1
        return DepthFrame(picture(at), camera(), self._own * STEP, self.name)

    def _fault(self, fault: str) -> DepthFrame | None:
        now = (self._own + 1) * STEP
        if fault == "OSError":
            raise OSError(19, "No such device")
        if fault == "RuntimeError":
            raise RuntimeError("Communication exception - possible device error")
        if fault == "another size":
            return DepthFrame(picture(0, 80, 60), camera(80, 60), now, self.name)
        if fault == "focal length nan":
            return DepthFrame(picture(0), camera(focal=float("nan")), now, self.name)
        if fault == "focal length zero":
            return DepthFrame(picture(0), camera(focal=0.0), now, self.name)
        if fault == "wrong type":
            return DepthFrame(picture(0).astype(np.float32), camera(), now, self.name)
        if fault == "wrong shape":
            return DepthFrame(picture(0, 80, 60), camera(), now, self.name)
        if fault == "negative time":
            return DepthFrame(picture(0), camera(), -5, self.name)
        if fault == "endless time":
            return DepthFrame(picture(0), camera(), 1 << 70, self.name)
        if fault == "no frame":
            return picture(0)
        if fault == "hangs":
            threading.Event().wait()
        raise AssertionError(fault)

    def close(self) -> None:
        self.closed = True

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
