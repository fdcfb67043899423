"""Moves that a camera makes by itself: it goes along with what travels, and around it like a turntable."""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Float
from enliven_viewer.render.camera import Box, OrbitCamera

_DELAY = 0.5
"""Seconds by which the camera lags behind what it follows: steps and waving arms do not shake the picture."""
_SLACK = 0.3
"""Share of the subject's radius that the camera is behind at most: who runs stays in the picture."""
_ROUND = 16.0
"""Seconds of a turn of the turntable: slow enough to look at."""


class CameraMoves:
    """Moves a camera as time passes, and keeps the direction, the distance and the place that were chosen.

    Attributes:
        follow: whether it goes along with its subject.
        turntable: whether it goes around.
    """

    def __init__(self) -> None:
        self.follow = self.turntable = False
        self._subject: Float | None = None

    def toggle_follow(self) -> None:
        """Follow, or stay; where the subject is now is where it stays in the picture."""
        self.follow = not self.follow
        self._subject = None

    def toggle_turntable(self) -> None:
        """Goes around, or stay."""
        self.turntable = not self.turntable

    def advance(self, camera: OrbitCamera, box: Box | None, seconds: float) -> None:
        """Lets seconds pass while the subject fills a box; without one the camera only goes around."""
        if self.turntable:
            camera.orbit(2 * math.pi * seconds / _ROUND, 0.0)
        if not self.follow or box is None:
            self._subject = None
            return
        middle = (box[0] + box[1]) / 2
        if self._subject is None:
            self._subject = middle
        before = self._subject
        behind = (before - middle) * math.exp(-seconds / _DELAY)
        limit = _SLACK * float(np.linalg.norm(box[1] - box[0])) / 2
        behind *= min(limit / max(float(np.linalg.norm(behind)), 1e-9), 1.0)
        self._subject = middle + behind
        camera.move(self._subject - before)
