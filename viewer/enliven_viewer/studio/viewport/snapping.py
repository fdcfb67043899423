"""Snapping of moves and turns: to a grid, to the floor, and to steps of an angle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float

_STILL = 1e-9
"""Metres: an axis along which nothing is moved keeps its place."""


@dataclass
class Snapping:
    """Whether what is dragged snaps, and to what.

    Attributes:
        on: the switch; a held key turns it the other way.
        grid: metres between two places.
        angle: degrees between two turns.
    """

    on: bool = False
    grid: float = 0.1
    angle: float = 15.0

    def acts(self, held: bool) -> bool:
        """Returns True if it snaps now; ``held``: whether its key is down."""
        return self.on != held

    def way(self, start: Float, way: Float) -> Float:
        """Returns (3,) metres near ``way`` that lead from (3,) ``start`` to a place of the grid.

        The floor is a height of the grid: where ``start`` is the lowest point of what is moved, it stands.
        """
        end = np.round((start + way) / self.grid) * self.grid
        return np.where(np.abs(way) > _STILL, end - start, way)

    def turn(self, radians: float) -> float:
        """Returns radians of the nearest step of the angle."""
        step = math.radians(self.angle)
        return round(radians / step) * step
