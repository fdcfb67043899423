"""A thing that is taken up, turned round in two hands and held: the hands take hold anew as it turns."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven import rotation
from enliven.arrays import Float
from enliven.meshes import Mesh
from enliven_synthesis.sensor.handled import arm_mesh

_LIFTED = 1.5
"""Seconds in which it is taken up before it turns."""
_TREMOR = 0.01
"""Metres by which hands do not hold it still."""
_ARM = 0.6
"""Metres of an arm that are in view, from the hand on."""
_SWAY = 0.03
"""Metres by which who holds it sways to and fro."""
_THICK = 4.0
"""Times that a trunk is as thick as an arm: 28 cm."""


@dataclass(frozen=True)
class InHandsWay:
    """The way of a thing that stands, is taken up by two hands, and turned once round before the camera.

    Attributes:
        begins: seconds for which it stands at first.
        period: seconds of a whole turn.
        lift: metres by which it is held higher than it stood.
        tilt: radians by which it leans to and fro as it turns.
        grips: how often each hand takes hold anew in a turn.
        reach: metres from the thing's axis, and above its lowest point, at which hands hold it.
        behind: metres behind it at which who holds it stands; 0: they are not in view but for their arms.
    """

    begins: float = 1.5
    period: float = 12.0
    lift: float = 0.25
    tilt: float = 0.15
    grips: int = 4
    reach: tuple[float, float] = (0.12, 0.22)
    behind: float = 0.0

    def world_from_thing(self, time: float) -> Float:
        """Returns the (4, 4) pose of the thing at a time in seconds."""
        share = min(max((time - self.begins) / _LIFTED, 0.0), 1.0)
        share = share * share * (3.0 - 2.0 * share)
        angle, shake = self._angle(time), share * _TREMOR
        lean = share * self.tilt * math.sin(2.0 * angle)
        turns = ([lean, 0.0, 0.0], [0.0, angle, 0.0])
        first, second = (rotation.to_matrix(rotation.from_rotation_vector(np.array(one))) for one in turns)
        pose = np.eye(4)
        pose[:3, :3] = first @ second
        wave = [math.sin(2.3 * time), math.sin(3.1 * time), math.sin(1.7 * time)]
        pose[:3, 3] = [0.0, share * self.lift, 0.0] + shake * np.array(wave)
        return pose

    def _angle(self, time: float) -> float:
        """Returns the radians by which it is turned."""
        passed = max(time - self.begins - _LIFTED, 0.0)
        return 2.0 * math.pi * min(passed, self.period) / self.period

    def arms(self, time: float) -> list[Mesh]:
        """Returns trunk and arms, world: each hand stays where it holds it, until it takes hold anew."""
        arms = list[Mesh]()
        if self.behind:
            feet = np.array([_SWAY * math.sin(1.9 * time), 0.0, -self.behind])
            arms.append(arm_mesh(feet + np.array([0.0, 1.3, 0.0]), feet, _THICK))
        if time < self.begins - 0.4:
            return arms
        pose, angle, step = self.world_from_thing(time), self._angle(time), 2.0 * math.pi / self.grips
        for side in (0, 1):
            # One hand after the other, where its own side of the thing then is.
            turned = step * math.floor(angle / step + 0.5 * side)
            at = math.pi * side - turned
            grip = [self.reach[0] * math.cos(at), self.reach[1], -self.reach[0] * math.sin(at)]
            hand = pose[:3, :3] @ np.array(grip) + pose[:3, 3]
            away = rotation.unit(np.array([0.8 if side == 0 else -0.8, 0.1, -1.0]))
            arms.append(arm_mesh(hand, hand + _ARM * away))
        return arms
