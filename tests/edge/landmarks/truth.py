"""A landmark source without errors: the synthetic performer's joints, projected into the image."""

from __future__ import annotations

import numpy as np

from enliven.camera import Intrinsics, project
from enliven.person.joints import Joint
from enliven_edge.landmarks.source import INDEX, NAMES, Landmarks

_LIMBS = {
    "shoulder": "SHOULDER", "elbow": "ELBOW", "wrist": "WRIST", "hip": "HIP", "knee": "KNEE",
    "ankle": "ANKLE", "foot index": "FOOT", "heel": "ANKLE",
    "index": "HAND", "pinky": "HAND", "thumb": "HAND",
}  # fmt: skip


def landmarks_of(
    joints: np.ndarray, camera: Intrinsics, world_from_camera: np.ndarray, scale: float = 1.0
) -> Landmarks:
    """Returns the exact landmarks of (20, 3) joints. ``scale`` multiplies their size."""
    places = np.tile(joints[Joint.HEAD], (len(NAMES), 1))
    for side in ("left", "right"):
        for name, joint in _LIMBS.items():
            places[INDEX[f"{side} {name}"]] = joints[Joint[f"{joint}_{side.upper()}"]]
    across = joints[Joint.SHOULDER_LEFT] - joints[Joint.SHOULDER_RIGHT]
    ears = 0.07 * across / np.linalg.norm(across)
    places[INDEX["left ear"]] += ears
    places[INDEX["right ear"]] -= ears
    local = (places - world_from_camera[:3, 3]) @ world_from_camera[:3, :3]
    points = project(local, camera)
    inside = ((points > -0.5) & (points < [camera.width - 0.5, camera.height - 0.5])).all(1)
    middle = 0.5 * (local[INDEX["left hip"]] + local[INDEX["right hip"]])
    return Landmarks(points, np.where(inside, 1.0, 0.1), scale * (local - middle))
