"""Framing: checks whether performers touch, and whether the image border cuts them off."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.camera import Intrinsics
from enliven.person import Body, Joint

_TOUCH_DISTANCE_M = 0.12
"""Maximum distance in metres between joints of two people who touch: the radii of two limbs and a small
gap."""
_MAX_REACH_M = 2.5
"""Two people cannot touch if their hips are farther apart than this along an axis, in metres."""
_MIN_DEPTH_M = 0.05
"""Minimum depth in metres along the optical axis for projecting a joint. It avoids a division by 0."""
WATCHED = np.array([Joint.HIP_CENTER, Joint.HEAD, Joint.FOOT_LEFT, Joint.FOOT_RIGHT])
"""The joints that must be in the image."""
_NAMES = ("hips", "head", "feet", "feet")
"""The names of the watched joints in messages."""


def find_touching(bodies: list[Body]) -> tuple[int, ...]:
    """Returns the ids of the first two people with touching joints, or an empty tuple."""
    for i, body in enumerate(bodies):
        for other in bodies[i + 1 :]:
            if np.abs(body.joints[0] - other.joints[0]).max() < _MAX_REACH_M:
                between = body.joints[:, None] - other.joints
                if float(np.einsum("abi,abi->ab", between, between).min()) < _TOUCH_DISTANCE_M**2:
                    return body.id, other.id
    return ()


def find_cut_off(local: Float, camera: Intrinsics) -> tuple[str, str]:
    """Returns the names of a watched joint outside the image and of the crossed border, or two empty strings.

    Args:
        local: (4, 3) positions of the watched joints in metres, camera frame.
        camera: the intrinsics.
    """
    z = np.maximum(local[:, 2], _MIN_DEPTH_M)
    u = camera.fx * local[:, 0] / z + camera.cx
    v = camera.fy * local[:, 1] / z + camera.cy
    borders = (
        ("lower", v > camera.height - 1), ("upper", v < 0), ("left", u < 0), ("right", u > camera.width - 1),
    )  # fmt: skip
    for side, out in borders:
        if out.any():
            return _NAMES[int(np.argmax(out))], side
    return "", ""
