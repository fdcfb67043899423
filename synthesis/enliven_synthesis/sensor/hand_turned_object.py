"""A simulated object that two hands pick up and turn round in the air, changing their grip."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven import rotation
from enliven.arrays import Float
from enliven.meshes import Mesh
from enliven_synthesis.sensor.moved_object import make_arm

_LIFT_TIME_S = 1.5
"""Seconds in which the object is picked up before it turns."""
_TREMOR_M = 0.01
"""Amplitude of the hands' tremor in metres."""
_ARM_LENGTH_M = 0.6
"""Visible length of an arm in metres, from the hand."""
_SWAY_M = 0.03
"""Sway amplitude in metres of the person who holds the object."""
_TRUNK_THICKNESS_RATIO = 4.0
"""Thickness of the trunk relative to an arm: 28 cm."""


@dataclass(frozen=True)
class HandTurnedPath:
    """The path of an object that rests, is picked up by two hands, and is turned once in front of the camera.

    Attributes:
        begins: seconds for which the object rests at first.
        period: duration of a full turn in seconds.
        lift: height in metres of the held object above its resting position.
        tilt: amplitude in radians of the object's tilt back and forth while it turns.
        grips: number of times that each hand changes its grip in a turn.
        reach: position of the grip in metres: distance from the object's axis, and height above its lowest
            point.
        behind: distance in metres of the person behind the object. If 0, only the arms are in view.
    """

    begins: float = 1.5
    period: float = 12.0
    lift: float = 0.25
    tilt: float = 0.15
    grips: int = 4
    reach: tuple[float, float] = (0.12, 0.22)
    behind: float = 0.0

    def world_from_object(self, time: float) -> Float:
        """Returns the (4, 4) pose of the object at a time in seconds."""
        share = min(max((time - self.begins) / _LIFT_TIME_S, 0.0), 1.0)
        share = share * share * (3.0 - 2.0 * share)
        angle, shake = self._rotation_angle(time), share * _TREMOR_M
        tilt = share * self.tilt * math.sin(2.0 * angle)
        turns = ([tilt, 0.0, 0.0], [0.0, angle, 0.0])
        first, second = (
            rotation.to_matrix(rotation.from_rotation_vector(np.array(vector))) for vector in turns
        )
        pose = np.eye(4)
        pose[:3, :3] = first @ second
        wave = [math.sin(2.3 * time), math.sin(3.1 * time), math.sin(1.7 * time)]
        pose[:3, 3] = [0.0, share * self.lift, 0.0] + shake * np.array(wave)
        return pose

    def _rotation_angle(self, time: float) -> float:
        """Returns the object's rotation angle in radians."""
        passed = max(time - self.begins - _LIFT_TIME_S, 0.0)
        return 2.0 * math.pi * min(passed, self.period) / self.period

    def arms(self, time: float) -> list[Mesh]:
        """Returns the meshes of trunk and arms in world coordinates.

        A hand holds the object at the same point until it changes its grip.
        """
        arms = list[Mesh]()
        if self.behind:
            feet = np.array([_SWAY_M * math.sin(1.9 * time), 0.0, -self.behind])
            arms.append(make_arm(feet + np.array([0.0, 1.3, 0.0]), feet, _TRUNK_THICKNESS_RATIO))
        if time < self.begins - 0.4:
            return arms
        pose, angle, step = (
            self.world_from_object(time),
            self._rotation_angle(time),
            2.0 * math.pi / self.grips,
        )
        for side in (0, 1):
            # The hands change their grip alternately, each on its own side of the object.
            turned = step * math.floor(angle / step + 0.5 * side)
            angle_of_grip = math.pi * side - turned
            grip = [
                self.reach[0] * math.cos(angle_of_grip),
                self.reach[1],
                -self.reach[0] * math.sin(angle_of_grip),
            ]
            hand = pose[:3, :3] @ np.array(grip) + pose[:3, 3]
            outward = rotation.unit(np.array([0.8 if side == 0 else -0.8, 0.1, -1.0]))
            arms.append(make_arm(hand, hand + _ARM_LENGTH_M * outward))
        return arms
