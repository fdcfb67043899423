"""A turntable under the thing that is scanned: it stands, then turns about a level axis evenly."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven import rotation
from enliven.arrays import Float
from enliven.meshes import Mesh

_STARTS = 0.5
"""Seconds in which a turntable comes to its speed."""


@dataclass(frozen=True)
class TurntableWay:
    """The way of a thing on a turntable; no hands are on it.

    Attributes:
        place: (x, z) metres, world, of the axis.
        begins: seconds for which it stands at first.
        period: seconds of a whole turn.
    """

    place: tuple[float, float] = (0.0, 0.0)
    begins: float = 1.5
    period: float = 12.0

    def world_from_thing(self, time: float) -> Float:
        """Returns the (4, 4) pose of the thing at a time in seconds."""
        passed = max(time - self.begins, 0.0)
        # Its speed grows evenly at first.
        even = passed - _STARTS / 2 if passed > _STARTS else passed * passed / (2 * _STARTS)
        pose, axis = np.eye(4), np.array([self.place[0], 0.0, self.place[1]])
        turn = np.array([0.0, 2.0 * math.pi * even / self.period, 0.0])
        pose[:3, :3] = rotation.to_matrix(rotation.from_rotation_vector(turn))
        pose[:3, 3] = axis - pose[:3, :3] @ axis
        return pose

    def arms(self, time: float) -> list[Mesh]:
        """Returns no arms."""
        return []
