"""Snapping of moves and turns: to a grid, to the floor, and to steps of an angle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float

_MOVEMENT_TOLERANCE_M = 1e-9
"""A coordinate that moves less than this in metres keeps its value."""


@dataclass
class Snapping:
    """The snapping settings of drags.

    Attributes:
        is_on: True if snapping is on. A pressed modifier key inverts this.
        grid: grid spacing in metres.
        angle: angle step in degrees.
    """

    is_on: bool = False
    grid: float = 0.1
    angle: float = 15.0

    def is_active(self, held: bool) -> bool:
        """Returns True if snapping is active. ``held`` is True if the modifier key is pressed."""
        return self.is_on != held

    def snap_offset(self, start: Float, way: Float) -> Float:
        """Returns the vector (3,) in metres nearest to ``way`` that leads from ``start`` (3,) to a grid
        point.

        The floor is on the grid. So if ``start`` is the object's lowest point, the object can snap to the
        floor.
        """
        end = np.round((start + way) / self.grid) * self.grid
        return np.where(np.abs(way) > _MOVEMENT_TOLERANCE_M, end - start, way)

    def snap_angle(self, radians: float) -> float:
        """Returns the angle in radians, rounded to the nearest step."""
        step = math.radians(self.angle)
        return round(radians / step) * step
