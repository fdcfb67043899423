"""Converts the 33 landmarks to the 20 joints."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.person import Joint
from enliven_edge.landmarks.source import INDEX, NAMES

_TRUNK = (0.11, 0.11, 0.10, 0.09)
"""Metres from skin to joint of hip centre, spine, shoulder centre and head."""
_ARM = (0.05, 0.04, 0.03, 0.025)
"""Metres from skin to joint of shoulder, elbow, wrist and hand."""
_LEG = (0.09, 0.055, 0.04, 0.03)
"""Metres from skin to joint of hip, knee, ankle and foot."""
SURFACE = np.array([*_TRUNK, *_ARM, *_ARM, *_LEG, *_LEG])
"""(20,) metres from the skin that a sensor sees to the joint behind it."""


def _weights() -> Float:
    """Returns (20, 33) the share of each landmark in a joint; every row sums to 1."""
    made = np.zeros((len(Joint), len(NAMES)))

    def put(joint: Joint, **parts: float) -> None:
        for name, share in parts.items():
            made[joint, INDEX[name.replace("_", " ")]] += share

    # The hip centre lies a little above the hips, the shoulder centre a little above the shoulders: parts of
    # the trunk's length, which is that from hips to shoulders.
    hips, shoulders = {"left_hip": 0.5, "right_hip": 0.5}, {"left_shoulder": 0.5, "right_shoulder": 0.5}
    for joint, up in ((Joint.HIP_CENTER, 0.17), (Joint.SPINE, 0.43), (Joint.SHOULDER_CENTER, 1.1)):
        put(joint, **{name: (1 - up) * share for name, share in hips.items()})
        put(joint, **{name: up * share for name, share in shoulders.items()})
    put(Joint.HEAD, left_ear=0.5, right_ear=0.5)
    for side in ("left", "right"):
        for part, name in (
            ("SHOULDER", "shoulder"), ("ELBOW", "elbow"), ("WRIST", "wrist"),
            ("HIP", "hip"), ("KNEE", "knee"), ("ANKLE", "ankle"), ("FOOT", "foot_index"),
        ):  # fmt: skip
            put(Joint[f"{part}_{side.upper()}"], **{f"{side}_{name}": 1.0})
        hand = Joint[f"HAND_{side.upper()}"]
        put(hand, **{f"{side}_wrist": 0.2, f"{side}_index": 0.4, f"{side}_pinky": 0.4})
    return made


WEIGHTS = _weights()
_USED = np.abs(WEIGHTS) > 0.15
"""(20, 33) the landmarks that a joint needs to be known."""


def joints_of(landmarks: Float) -> Float:
    """Returns (20, D) joints of (33, D) landmarks, in pixels or metres."""
    return np.asarray(WEIGHTS @ landmarks)


def visibility_of(visibility: Float) -> Float:
    """Returns (20,) the probability that each joint is seen: that of its least visible landmark."""
    return np.asarray(np.where(_USED, visibility, 1.0).min(1))
