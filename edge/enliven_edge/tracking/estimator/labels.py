"""The labels that the network learns: body parts and facing directions."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from enliven.kernels import njit


class BodyPart(IntEnum):
    """Regions of the body's surface. Left and right are the person's own."""

    HEAD = 0
    CHEST_LEFT = 1
    CHEST_RIGHT = 2
    BELLY_LEFT = 3
    BELLY_RIGHT = 4
    UPPER_ARM_LEFT = 5
    UPPER_ARM_RIGHT = 6
    FOREARM_LEFT = 7
    FOREARM_RIGHT = 8
    HAND_LEFT = 9
    HAND_RIGHT = 10
    THIGH_LEFT = 11
    THIGH_RIGHT = 12
    SHANK_LEFT = 13
    SHANK_RIGHT = 14
    FOOT_LEFT = 15
    FOOT_RIGHT = 16


PARTS = len(BodyPart)
NOBODY = 255
"""The label of a pixel without a body part: the largest value of a byte."""
FACINGS = 8
"""Number of facing directions that the network distinguishes, one every 45 degrees."""
MIRRORED = np.array([0, *(p + 1 if p % 2 else p - 1 for p in range(1, PARTS))])
"""(17,) the mirrored part of each part, on the other side of the body."""


@njit(cache=True, nogil=True)
def facing_in_plan(left, place, eye):
    """Returns the person's horizontal facing in radians: 0 towards the sensor, anticlockwise from above.

    Args:
        left: (3,) direction to the person's left, world frame. Unlike the front direction it stays level when
            the person bends.
        place, eye: (3,) metres, of the person and the sensor.
    """
    return np.arctan2(-left[2], left[0]) - np.arctan2(eye[0] - place[0], eye[2] - place[2])
