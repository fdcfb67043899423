"""A driver whose device tells bodies by itself."""

from __future__ import annotations

import itertools

from enliven.frames import BodyFrame
from enliven_edge.sensors.synthetic import SyntheticSensor

STEP = 40_000_000
"""Nanoseconds between two frames."""


class Telling:
    """Five frames of a synthetic performer's true bodies."""

    isolated = True
    name = "telling"
    fps = 25.0

    def __init__(self) -> None:
        self._performer = SyntheticSensor(choreography="walk", realtime=False)
        self._times = itertools.count(0, STEP)

    def read(self, timeout: float | None = None) -> BodyFrame | None:
        """The next."""
        time_ns = next(self._times)
        return BodyFrame([self._performer.truth(time_ns)], time_ns, self.name) if time_ns < 5 * STEP else None

    def close(self) -> None:
        """Nothing to do."""
