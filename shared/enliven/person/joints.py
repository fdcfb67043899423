"""The 20 joints of a tracked person, and the tree that they form."""

from __future__ import annotations

from enum import IntEnum


class Joint(IntEnum):
    """The 20 joints of the Kinect SDK 1.x, in its order. Left and right are the performer's own."""

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

BODY_NAMES: tuple[str, ...] = tuple(joint.name.lower().replace("_", " ") for joint in Joint)
"""Names of the 20 joints of a tracked person in a clip: "hip center", "spine", ..."""

PARENTS: tuple[int, ...] = (-1, 0, 1, 2, 2, 4, 5, 6, 2, 8, 9, 10, 0, 12, 13, 14, 0, 16, 17, 18)
"""(20,) the parent of each joint, -1 at the root (the hip centre). Parents precede children."""

BONES: tuple[tuple[int, int], ...] = tuple(
    (parent, joint) for joint, parent in enumerate(PARENTS) if parent >= 0
)
"""(19, 2) parent and child joint of each bone, ordered by child joint."""

MIRROR: tuple[int, ...] = (0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7, 16, 17, 18, 19, 12, 13, 14, 15)
"""(20,) for each joint, the corresponding joint on the other side of the body. Joints of the trunk map to
themselves."""
