"""The feet of a person who is scanned: the pixels just above the floor that the tracker leaves out."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.camera import rays
from enliven.frames import DepthFrame
from enliven.person import Body, Joint

_SEEN = 0.5
"""Confidence from which a joint's place counts."""
_FOOT = 0.16
"""Metres in plan about ankles and toes in which what lies low is a foot: half its length."""
LOW = 0.12
"""Metres above the floor up to which it may be, for the tracker leaves out what is so near the floor."""
_SOLE = 0.02
"""Metres above the floor that count as the floor: its noise at two to three metres."""


def feet_pixels(frame: DepthFrame, body: Body, world_from_camera: Float) -> Bool:
    """Returns (H, W) the pixels just above the floor about the ankles and toes that are seen."""
    ray, z = rays(frame.intrinsics), frame.depth[..., None] * 1e-3
    rows = np.flatnonzero((frame.depth > 0).any(1))
    turn, place = world_from_camera[:3, :3], world_from_camera[:3, 3]
    points = np.concatenate([ray[rows] * z[rows], z[rows]], -1) @ turn.T + place
    low = (points[..., 1] > _SOLE) & (points[..., 1] < LOW)
    near = np.zeros(low.shape, bool)
    for joint in (Joint.ANKLE_LEFT, Joint.FOOT_LEFT, Joint.ANKLE_RIGHT, Joint.FOOT_RIGHT):
        if body.confidence[joint] >= _SEEN:
            away = points[..., [0, 2]] - body.joints[joint, [0, 2]]
            near |= np.square(away).sum(-1) < _FOOT**2
    feet: Bool = np.zeros(frame.depth.shape, bool)
    feet[rows] = low & near
    return feet
