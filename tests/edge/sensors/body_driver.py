"""A driver of a device that tracks bodies itself."""

from __future__ import annotations

import numpy as np

from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven_edge.sensors.base import Sensor

FRAMES = 5
STEP = 40_000_000
"""Nanoseconds between two frames."""


def bodies(number: int) -> list[Body]:
    """Returns ``number`` bodies, all different."""
    random = np.random.default_rng(number)
    return [Body(i, random.normal(size=(20, 3)), random.uniform(size=20), stature=1.7) for i in range(number)]


class BodyDriver(Sensor):
    """A sensor of frames with an increasing number of bodies."""

    isolated = True
    name = "telling"
    fps = 25.0

    def __init__(self) -> None:
        self._next = 0

    def read(self, timeout: float | None = None) -> BodyFrame | None:
        """Returns the next frame."""
        number, self._next = self._next, self._next + 1
        return BodyFrame(bodies(number), number * STEP, self.name) if number < FRAMES else None

    def close(self) -> None:
        """Does nothing, since there is no device."""
