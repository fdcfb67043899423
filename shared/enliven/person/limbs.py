"""The 16 limbs of a person between the 20 joints, each with a rigid coordinate frame."""

from __future__ import annotations

from enum import IntEnum


class Limb(IntEnum):
    """The 16 limbs of a person. The coordinate frame of each limb has its origin at the joint nearer to the
    pelvis.
    """

    PELVIS = 0
    ABDOMEN = 1
    CHEST = 2
    SKULL = 3
    UPPER_ARM_LEFT = 4
    UPPER_ARM_RIGHT = 5
    FOREARM_LEFT = 6
    FOREARM_RIGHT = 7
    HAND_LEFT = 8
    HAND_RIGHT = 9
    THIGH_LEFT = 10
    THIGH_RIGHT = 11
    SHANK_LEFT = 12
    SHANK_RIGHT = 13
    FOOT_LEFT = 14
    FOOT_RIGHT = 15
