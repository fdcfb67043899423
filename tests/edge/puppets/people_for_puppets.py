"""People that stand, wave, walk and jump, for tests of puppets on the stage."""

from __future__ import annotations

import numpy as np

from enliven.person.body import Body
from enliven.person.parts import PARTS
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation

FRAME = 33_333_333
ARMS = sorted(PARTS["arms"])


def person(id=1, x=0.0, z=-2.5, yaw=0.0, left=0.0, right=0.0, knees=(0.0, 0.0), up=0.0, height=1.75) -> Body:
    """Returns a person with arms lifted sideways and knees lifted by the given angles, radians.

    Args:
        up: height above the floor, metres.
    """
    turns = standing_pose(yaw)
    turns[model.UPPER_ARM_L] = rotation(z=left) @ turns[model.UPPER_ARM_L]
    turns[model.UPPER_ARM_R] = rotation(z=-right) @ turns[model.UPPER_ARM_R]
    for thigh, shin, knee in zip(
        (model.THIGH_L, model.THIGH_R), (model.SHIN_L, model.SHIN_R), knees, strict=True
    ):
        turns[thigh] = rotation(x=-knee) @ turns[thigh]
        turns[shin] = rotation(x=knee) @ turns[shin]
    posture = Posture(np.array([x, 1.0, z]), turns, model.lengths_for_height(height))
    joints = posture.joints()
    joints[:, 1] += up - joints[:, 1].min()
    return Body(id, joints, np.ones(20), stature=height)
