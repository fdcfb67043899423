"""Where performers stand: in the image, and with each other."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.camera import Intrinsics
from enliven.person import Body, Joint

_TOUCH, _ARMS_LENGTHS = 0.12, 2.5
"""Metres between two people's joints that touch, and between their hips when any can."""
WATCHED = np.array([Joint.HIP_CENTER, Joint.HEAD, Joint.FOOT_LEFT, Joint.FOOT_RIGHT])
"""The joints that must be in the image."""
_NAMES = ("hips", "head", "feet", "feet")


def touching(bodies: list[Body]) -> tuple[int, ...]:
    """The ids of the first two people of whom a joint of one is at a joint of the other; or nobody's."""
    for i, one in enumerate(bodies):
        for other in bodies[i + 1 :]:
            if np.abs(one.joints[0] - other.joints[0]).max() < _ARMS_LENGTHS:
                between = one.joints[:, None] - other.joints
                if float(np.einsum("abi,abi->ab", between, between).min()) < _TOUCH**2:
                    return one.id, other.id
    return ()


def cut_off(local: Float, camera: Intrinsics) -> tuple[str, str]:
    """What of hips, head and feet (4, 3), camera frame, is out of the image, and beyond which border."""
    z = np.maximum(local[:, 2], 0.05)
    u = camera.fx * local[:, 0] / z + camera.cx
    v = camera.fy * local[:, 1] / z + camera.cy
    borders = (
        ("lower", v > camera.height - 1), ("upper", v < 0), ("left", u < 0), ("right", u > camera.width - 1),
    )  # fmt: skip
    for side, out in borders:
        if out.any():
            return _NAMES[int(np.argmax(out))], side
    return "", ""
