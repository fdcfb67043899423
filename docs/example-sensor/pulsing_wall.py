"""A sensor of another package: a wall that comes and goes, in place of your camera's library."""

import math
import time

import numpy as np

from enliven.camera import Intrinsics
from enliven.frames import DepthFrame
from enliven_edge.sensors.base import Condition, Sensor


class PulsingWall(Sensor):
    """Opens, reads, closes: all that a driver does. Its base class has defaults for the rest."""

    isolated = True  # a process of its own, so that a crash of your library is not the edge's

    def __init__(self, serial: str = "1", fps: float = 30.0) -> None:
        """Opens the device; the arguments are what --set takes. Raise ResourceError where it is missing."""
        self.name, self.fps = f"pulsing-wall {serial}", fps
        self._camera = Intrinsics(320, 200, 220.0, 220.0, 159.5, 99.5)
        self._number, self._start = 0, time.monotonic()

    def read(self, timeout: float | None = None) -> DepthFrame | None:
        """The next frame; TimeoutError where none came in time, any other error where the device was lost."""
        due = self._start + self._number / self.fps - time.monotonic()
        if timeout is not None and due > timeout:
            time.sleep(timeout)
            raise TimeoutError
        time.sleep(max(due, 0.0))
        self._number += 1
        distance = 2000 + round(200 * math.sin(self._number / self.fps))
        depth = np.full((200, 320), distance, np.uint16)  # millimetres, 0 where nothing is known
        time_ns = round(1e9 * self._number / self.fps)  # the device's own clock
        return DepthFrame(depth, self._camera, time_ns, self.name, sequence=self._number)

    def condition(self) -> Condition:
        """How the device fares; leave this out where it cannot say."""
        return Condition(link="USB 3", temperature=40.0, hot=85.0, gravity=(0.0, 1.0, 0.0))

    def close(self) -> None:
        """Lets the device go."""
