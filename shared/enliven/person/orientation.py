"""Mirrors a body in a plane."""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray
from enliven.person.body import Body
from enliven.person.joints import MIRROR
from enliven.rotation import multiply

_MIRROR = np.array(MIRROR)
_HALF_TURN = np.array([0.0, 1.0, 0.0, 0.0])
"""(4,) a half turn about x."""


def mirror_body(body: Body, point: AnyArray, normal: AnyArray) -> Body:
    """Reflects the body in a plane, and exchanges left and right. Reflecting twice returns the original body.

    Reflecting all axes of a bone's frame would make it left-handed. So only its front and its longitudinal
    axis are reflected, and the third axis is chosen so that the frame stays right-handed.

    Args:
        point: (3,) any point of the mirror, metres, world frame.
        normal: (3,) unit normal of the mirror.
    """
    normal = np.asarray(normal, np.float64)
    signed_distances = (body.joints - np.asarray(point, np.float64)) @ normal
    joints = (body.joints - 2.0 * signed_distances[:, None] * normal)[_MIRROR]
    orientations = None
    if body.orientations is not None:
        # A bone with the rotation R gets the rotation M R D. M is the reflection in the plane with the normal
        # n, and D the reflection of the bone's x axis. A reflection is the negative of a half turn, which has
        # the quaternion (0, axis). So M R D = turn(n, pi) R turn(x, pi).
        half_turn = np.concatenate([[0.0], normal])
        orientations = multiply(multiply(half_turn, body.orientations), _HALF_TURN)[_MIRROR]
    contacts = None if body.contacts is None else body.contacts[::-1].copy()
    return Body(body.id, joints, body.confidence[_MIRROR], orientations, contacts, body.stature)
