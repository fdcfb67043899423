"""Measures how long all performers have held still. This can end a recording without a key press."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.frames import BodyFrame
from enliven_viewer.playback.timeline import NS_PER_S

_MAX_MOVEMENT_M = 0.06
"""Maximum movement of a joint in metres of a performer that holds still. It allows for breathing and sensor
noise.
"""
_MIN_CONFIDENCE = 0.3
"""Joints below this confidence are ignored. Positions of occluded joints are guesses that jump."""


class Stillness:
    """Measures the stillness of the performers in view. It starts only after at least one performer has
    moved.

    Attributes:
        since_ns: time on the sensor's clock since which all performers are still; None if one moves or none
            is in view.
    """

    def __init__(self) -> None:
        self.since_ns: int | None = None
        self._has_moved = False
        self._places: dict[int, Float] = {}

    def add_frame(self, frame: BodyFrame) -> None:
        """Processes the performers of a frame."""
        moved = len(frame.bodies) == 0
        for body in frame.bodies:
            place = self._places.get(body.id)
            off = 0.0
            if place is not None:
                far = np.linalg.norm(body.joints - place, axis=1)
                off = float(np.max(far, where=body.confidence > _MIN_CONFIDENCE, initial=0.0))
            if place is None or off > _MAX_MOVEMENT_M:
                self._places[body.id], moved = body.joints, True
                self._has_moved |= place is not None
        if moved:
            self.since_ns = None
        elif self.since_ns is None:
            self.since_ns = frame.time_ns

    def seconds(self, now_ns: int) -> float:
        """Returns the seconds for which all performers have held still since the last movement, or 0 before
        the first movement.
        """
        if self.since_ns is None or not self._has_moved:
            return 0.0
        return max(now_ns - self.since_ns, 0) / NS_PER_S
