"""Automatic camera movements: following a moving subject, and a turntable."""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Float
from enliven_viewer.render.camera import Box, OrbitCamera

_LAG_S = 0.5
"""Lag in seconds behind the subject, so that steps and waving arms do not shake the image."""
_MAX_LAG_FRACTION = 0.3
"""Maximum lag as a fraction of the subject's radius, so that a running subject stays in view."""
_TURNTABLE_PERIOD_S = 16.0
"""Seconds per turn of the turntable: slow enough to examine the subject."""


class CameraMoves:
    """Automatic movements of a camera that keep the direction, distance and framing chosen by the user.

    Attributes:
        follow: whether the camera follows its subject.
        turntable: whether the camera orbits.
    """

    def __init__(self) -> None:
        self.follow = self.turntable = False
        self._subject: Float | None = None

    def toggle_follow(self) -> None:
        """Switches following on or off. The subject stays at its current position in the image."""
        self.follow = not self.follow
        self._subject = None

    def toggle_turntable(self) -> None:
        """Switches the turntable on or off."""
        self.turntable = not self.turntable

    def advance(self, camera: OrbitCamera, box: Box | None, seconds: float) -> None:
        """Advances time. ``box`` contains the subject. Without a box, only the turntable rotates."""
        if self.turntable:
            camera.orbit(2 * math.pi * seconds / _TURNTABLE_PERIOD_S, 0.0)
        if not self.follow or box is None:
            self._subject = None
            return
        middle = (box[0] + box[1]) / 2
        if self._subject is None:
            self._subject = middle
        old_subject = self._subject
        lag = (old_subject - middle) * math.exp(-seconds / _LAG_S)
        limit = _MAX_LAG_FRACTION * float(np.linalg.norm(box[1] - box[0])) / 2
        lag *= min(limit / max(float(np.linalg.norm(lag)), 1e-9), 1.0)
        self._subject = middle + lag
        camera.move(self._subject - old_subject)
