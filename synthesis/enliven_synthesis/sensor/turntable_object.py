"""A simulated turntable under the scanned object. It stands at first, then turns at constant speed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven import rotation
from enliven.arrays import Float
from enliven.meshes import Mesh

_START_TIME_S = 0.5
"""Seconds in which the turntable reaches its speed."""


@dataclass(frozen=True)
class TurntablePath:
    """The path of an object on a turntable. No hands hold it.

    Attributes:
        place: (x, z) position of the axis in metres, world frame.
        begins: seconds for which the turntable stands at first.
        period: duration of a full turn in seconds.
    """

    place: tuple[float, float] = (0.0, 0.0)
    begins: float = 1.5
    period: float = 12.0

    def world_from_object(self, time: float) -> Float:
        """Returns the (4, 4) pose of the object at a time in seconds."""
        passed = max(time - self.begins, 0.0)
        # The speed of the turntable grows linearly at first.
        even = passed - _START_TIME_S / 2 if passed > _START_TIME_S else passed * passed / (2 * _START_TIME_S)
        pose, axis = np.eye(4), np.array([self.place[0], 0.0, self.place[1]])
        turn = np.array([0.0, 2.0 * math.pi * even / self.period, 0.0])
        pose[:3, :3] = rotation.to_matrix(rotation.from_rotation_vector(turn))
        pose[:3, 3] = axis - pose[:3, :3] @ axis
        return pose

    def arms(self, time: float) -> list[Mesh]:
        """Returns an empty list, because no arms are in view."""
        return []
