"""A driver whose library crashes, hangs, goes silent, or prints."""

from __future__ import annotations

import ctypes
import os
import sys
import time
from pathlib import Path

import numpy as np
from troubled import STEP, camera, picture

from enliven.errors import ResourceError
from enliven.frames import DepthFrame
from enliven_edge.sensors.base import Condition, Sensor


class Wild(Sensor):
    """A sensor of endless frames, numbered in their first pixel, with one failure at frame ``after``.

    Args:
        folder: each device writes a file there, so that the next device does not fail. If a file ``gone``
            exists, the device is unplugged. If a file ``slow`` exists, opening has not finished.
        mishap: the failure, which happens once.
    """

    isolated = True
    name = "wild"
    fps = 30.0

    def __init__(
        self,
        folder: str,
        mishap: str = "",
        after: int = 5,
        pace: float = 0.005,
        width: int = 64,
        height: int = 48,
        before: str = "",
    ) -> None:
        self.folder, self.after, self.pace, self.size = Path(folder), after, pace, (width, height)
        if (self.folder / "gone").exists():
            raise ResourceError("no device", where="wild", remedy="Plug it in.")
        while (self.folder / "slow").exists():
            time.sleep(0.01)
        if mishap == "crashes at open":
            os.abort()
        self.number, self.again = 0, {"before": "wild"}
        (self.folder / f"asked-for-{before or 'any'}").touch()
        earlier = len(list(self.folder.glob("device-*")))
        (self.folder / f"device-{os.getpid()}-{earlier}").touch()
        self.mishap = mishap if earlier == 0 or mishap.startswith("always ") else ""
        print("a banner that a library prints")

    def read(self, timeout: float | None = None) -> DepthFrame | None:
        time.sleep(self.pace)
        if (self.folder / "gone").exists():
            raise OSError(19, "No such device")
        self.number += 1
        width, height = self.size
        if self.number >= self.after and self.mishap:
            mishap = self.mishap.removeprefix("always ")
            if mishap == "crashes":
                ctypes.string_at(0)
            if mishap == "exits":
                sys.stdout.flush()
                os._exit(3)
            if mishap == "hangs":
                ctypes.CDLL(None).pause()
            if mishap == "goes silent":
                time.sleep(timeout or 0.0)
                raise TimeoutError
            if mishap == "another size":
                width, height = 96, 72
            if mishap == "ends":
                return None
        depth = picture(self.number % 7, width, height)
        depth[0, 0] = self.number
        colour = np.full((height, width, 3), self.number % 256, np.uint8)
        time_ns = self.number * STEP
        return DepthFrame(depth, camera(width, height), time_ns, self.name, colour, sequence=self.number)

    def condition(self) -> Condition:
        return Condition("USB 2", slow_link=True, temperature=41.5, hot=80.0, gravity=(0.0, 9.8, 0.1))

    def close(self) -> None:
        if self.mishap == "does not close":
            ctypes.CDLL(None).pause()
        (self.folder / f"closed-{os.getpid()}").touch()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
