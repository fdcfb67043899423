"""The tracked person: 20 joints, the bones between them, and the named parts one may possess with."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from enliven.arrays import Float


class Joint(IntEnum):
    """The 20 joints of the Kinect SDK 1.x, in its order; left and right are the performer's own."""

    HIP_CENTER = 0
    SPINE = 1
    SHOULDER_CENTER = 2
    HEAD = 3
    SHOULDER_LEFT = 4
    ELBOW_LEFT = 5
    WRIST_LEFT = 6
    HAND_LEFT = 7
    SHOULDER_RIGHT = 8
    ELBOW_RIGHT = 9
    WRIST_RIGHT = 10
    HAND_RIGHT = 11
    HIP_LEFT = 12
    KNEE_LEFT = 13
    ANKLE_LEFT = 14
    FOOT_LEFT = 15
    HIP_RIGHT = 16
    KNEE_RIGHT = 17
    ANKLE_RIGHT = 18
    FOOT_RIGHT = 19


J = len(Joint)

PARENTS: tuple[int, ...] = (-1, 0, 1, 2, 2, 4, 5, 6, 2, 8, 9, 10, 0, 12, 13, 14, 0, 16, 17, 18)
"""(20,) the parent of each joint; -1 at the root (the hip centre). Parents come before children."""

BONES: tuple[tuple[int, int], ...] = tuple(
    (parent, joint) for joint, parent in enumerate(PARENTS) if parent >= 0
)
"""(19, 2) parent and child joint of each bone, ordered by child joint."""

_ARM_LEFT = frozenset({Joint.SHOULDER_LEFT, Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.HAND_LEFT})
_ARM_RIGHT = frozenset({Joint.SHOULDER_RIGHT, Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT, Joint.HAND_RIGHT})
_LEG_LEFT = frozenset({Joint.HIP_LEFT, Joint.KNEE_LEFT, Joint.ANKLE_LEFT, Joint.FOOT_LEFT})
_LEG_RIGHT = frozenset({Joint.HIP_RIGHT, Joint.KNEE_RIGHT, Joint.ANKLE_RIGHT, Joint.FOOT_RIGHT})
_TORSO = frozenset({Joint.HIP_CENTER, Joint.SPINE, Joint.SHOULDER_CENTER, Joint.HEAD})

PARTS: dict[str, frozenset[Joint]] = {
    "all": frozenset(Joint),
    "left arm": _ARM_LEFT,
    "right arm": _ARM_RIGHT,
    "arms": _ARM_LEFT | _ARM_RIGHT,
    "left leg": _LEG_LEFT,
    "right leg": _LEG_RIGHT,
    "legs": _LEG_LEFT | _LEG_RIGHT,
    "torso": _TORSO,
    "upper body": _TORSO | _ARM_LEFT | _ARM_RIGHT,
    "lower body": _LEG_LEFT | _LEG_RIGHT | {Joint.HIP_CENTER},
    "hip and right arm": _ARM_RIGHT | {Joint.HIP_CENTER},
    "hip and left arm": _ARM_LEFT | {Joint.HIP_CENTER},
}
"""Named subsets of the body (KinÊtre: "left arm", "upper body", ...); a bone belongs to its child joint."""


@dataclass(frozen=True)
class Body:
    """One person at one moment.

    Attributes:
        id: stable while the person is in view.
        joints: (20, 3) float64 metres, world frame, ordered by :class:`Joint`.
        confidence: (20,) float64 in [0, 1]; 0 where the joint is a guess that must not pull anything.
        orientations: (20, 4) unit quaternions world_from_bone of the bone that ends at the joint, or None.
    """

    id: int
    joints: Float
    confidence: Float
    orientations: Float | None = None

    @property
    def height(self) -> float:
        """Metres from the soles to the crown, as the bones' lengths stand (not the posture's)."""
        chain = (Joint.SPINE, Joint.SHOULDER_CENTER, Joint.HEAD, Joint.KNEE_LEFT, Joint.ANKLE_LEFT)
        length = sum(float(np.linalg.norm(self.joints[j] - self.joints[PARENTS[j]])) for j in chain)
        hips = self.joints[[Joint.HIP_LEFT, Joint.HIP_RIGHT]].mean(0)
        length += float(np.linalg.norm(self.joints[Joint.HIP_CENTER] - hips))
        return length + HEAD_ABOVE_JOINT + ANKLE_ABOVE_SOLE


HEAD_ABOVE_JOINT = 0.12
"""Metres from the head joint to the crown of an average adult."""
ANKLE_ABOVE_SOLE = 0.08
"""Metres from the ankle joint to the sole of an average adult."""
