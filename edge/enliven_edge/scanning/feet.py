"""The feet of a scanned person: the pixels just above the floor, which the tracker does not assign to a
person.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.camera import pixel_rays
from enliven.frames import DepthFrame
from enliven.person import Body, Joint

_MIN_CONFIDENCE = 0.5
"""Minimum confidence of a joint that is used."""
_FOOT_RADIUS_M = 0.16
"""Maximum horizontal distance in metres of a foot's low pixels from ankles and toes: half a foot's length."""
MAX_FOOT_HEIGHT_M = 0.12
"""Maximum height of foot pixels above the floor in metres. The tracker ignores pixels below this height."""
_FLOOR_NOISE_M = 0.02
"""Height in metres up to which points count as the floor. It is the depth noise of the floor at a distance of
two to three metres."""


def feet_pixels(frame: DepthFrame, body: Body, world_from_camera: Float) -> Bool:
    """Returns a mask (H, W) of the pixels that are just above the floor and near the visible ankles and
    toes.
    """
    ray, z = pixel_rays(frame.intrinsics), frame.depth[..., None] * 1e-3
    rows = np.flatnonzero((frame.depth > 0).any(1))
    turn, place = world_from_camera[:3, :3], world_from_camera[:3, 3]
    points = np.concatenate([ray[rows] * z[rows], z[rows]], -1) @ turn.T + place
    low = (points[..., 1] > _FLOOR_NOISE_M) & (points[..., 1] < MAX_FOOT_HEIGHT_M)
    is_near = np.zeros(low.shape, bool)
    for joint in (Joint.ANKLE_LEFT, Joint.FOOT_LEFT, Joint.ANKLE_RIGHT, Joint.FOOT_RIGHT):
        if body.confidence[joint] >= _MIN_CONFIDENCE:
            offsets = points[..., [0, 2]] - body.joints[joint, [0, 2]]
            is_near |= np.square(offsets).sum(-1) < _FOOT_RADIUS_M**2
    feet: Bool = np.zeros(frame.depth.shape, bool)
    feet[rows] = low & is_near
    return feet
