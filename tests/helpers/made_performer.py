"""A synthetic recording of bodies. A person stands still, and then swings the arms and steps."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven.recording import Recorder
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation

RATE = 60
"""Frames per second. Played at a quarter of the speed, it still equals a slow camera's 15 frames per second.
"""
STILL, LENGTH = 3.0, 18.0
"""Seconds for which the performer stands with lifted arms, and length of the loop in seconds."""
_LIFTED_ARMS = 1.75
"""Angle from hanging to which the arms are lifted, radians. Slightly above horizontal."""


def performer(second: float) -> Body:
    """Returns the performer at a second: still with lifted arms, then swinging the arms and stepping."""
    moves = _smooth(second, STILL, STILL + 1.0) - _smooth(second, LENGTH - 1.0, LENGTH)
    turn = 2 * np.pi * second / 1.6
    rotations = standing_pose()
    left, right = 0.55 * moves * np.sin(turn), 0.55 * moves * np.sin(turn + 2.0)
    rotations[model.UPPER_ARM_L] = rotation(z=_LIFTED_ARMS + left)
    rotations[model.UPPER_ARM_R] = rotation(z=-_LIFTED_ARMS - right)
    rotations[model.FOREARM_L] = rotation(z=0.5 * left)
    rotations[model.FOREARM_R] = rotation(z=-0.5 * right)
    for side, thigh, shin in ((1.0, model.THIGH_L, model.SHIN_L), (-1.0, model.THIGH_R, model.SHIN_R)):
        lift = moves * max(side * np.sin(turn), 0.0)
        rotations[thigh] = rotation(x=-0.9 * lift, z=0.12 * side) @ rotations[thigh]
        rotations[shin] = rotation(x=0.05 + 1.1 * lift)
    posture = Posture(np.array([0.0, 0.94, -2.5]), rotations, model.lengths_for_height(1.75))
    return Body(1, posture.joints(), np.ones(20), posture.orientations(), stature=1.75)


def _smooth(at: float, begin: float, end: float) -> float:
    share = min(max((at - begin) / (end - begin), 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


def write_performer(path: Path) -> None:
    """Writes one loop of the performance in the format of a tracked sensor."""
    with Recorder(path, overwrite=True) as recorder:
        for frame in range(round(LENGTH * RATE)):
            body = performer(frame / RATE)
            recorder.write_frame(BodyFrame([body], 10**9 + round(frame * 1e9 / RATE), "made"))
