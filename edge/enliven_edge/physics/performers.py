"""A performer as spheres: those who hold no character push with their own body."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.person import BONES, Body, Joint

_RADII = np.full(len(Joint), 0.07)
_RADII[[Joint.HIP_CENTER, Joint.SPINE, Joint.SHOULDER_CENTER]] = 0.13
_RADII[[Joint.HIP_LEFT, Joint.HIP_RIGHT]] = 0.11
_RADII[[Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT, Joint.HEAD]] = 0.10
_RADII[[Joint.KNEE_LEFT, Joint.KNEE_RIGHT]] = 0.08
_RADII[[Joint.ELBOW_LEFT, Joint.ELBOW_RIGHT, Joint.WRIST_LEFT, Joint.WRIST_RIGHT]] = 0.055
"""(20,) metres around each joint of somebody 1.75 m tall."""
_SHARES = np.array([1 / 3, 2 / 3])
BODY_SPHERES = len(Joint) + len(_SHARES) * len(BONES)


def body_spheres(body: Body) -> tuple[Float, Float]:
    """(BODY_SPHERES, 3) centres and (BODY_SPHERES,) radii, metres: each joint, and two along each bone.

    A joint that is not finite takes its spheres with it.
    """
    start, end = np.array(BONES).T
    size = float(np.clip(body.height / 1.75, 0.3, 1.6)) if np.isfinite(body.joints).all() else 1.0
    path = body.joints[end] - body.joints[start]
    along = [body.joints[start] + share * path for share in _SHARES]
    radii = [_RADII[start] + share * (_RADII[end] - _RADII[start]) for share in _SHARES]
    return np.concatenate([body.joints, *along]), size * np.concatenate([_RADII, *radii])
