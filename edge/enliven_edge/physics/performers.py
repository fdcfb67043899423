"""Spheres around a performer's body: performers who hold no character push with their own body."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.person import BONES, Body, Joint


def _radii() -> Float:
    """Returns (20,) metres around each joint of a person 1.75 m tall."""
    radii = np.full(len(Joint), 0.07)
    radii[[Joint.HIP_CENTER, Joint.SPINE, Joint.SHOULDER_CENTER]] = 0.13
    radii[[Joint.HIP_LEFT, Joint.HIP_RIGHT]] = 0.11
    radii[[Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT, Joint.HEAD]] = 0.10
    radii[[Joint.KNEE_LEFT, Joint.KNEE_RIGHT]] = 0.08
    radii[[Joint.ELBOW_LEFT, Joint.ELBOW_RIGHT, Joint.WRIST_LEFT, Joint.WRIST_RIGHT]] = 0.055
    return radii


_RADII = _radii()
_SHARES = np.array([1 / 3, 2 / 3])
"""Shares of a bone's length at which its two spheres lie."""
BODY_SPHERES = len(Joint) + len(_SHARES) * len(BONES)
"""Spheres of one body: one at each joint, and two along each bone."""


def body_spheres(body: Body) -> tuple[Float, Float]:
    """Returns (BODY_SPHERES, 3) centres and (BODY_SPHERES,) radii, metres: each joint, and two along each
    bone.

    A joint that is not finite takes its spheres with it.
    """
    start, end = np.array(BONES).T
    size = float(np.clip(body.height / 1.75, 0.3, 1.6)) if np.isfinite(body.joints).all() else 1.0
    path = body.joints[end] - body.joints[start]
    along = [body.joints[start] + share * path for share in _SHARES]
    radii = [_RADII[start] + share * (_RADII[end] - _RADII[start]) for share in _SHARES]
    return np.concatenate([body.joints, *along]), size * np.concatenate([_RADII, *radii])
