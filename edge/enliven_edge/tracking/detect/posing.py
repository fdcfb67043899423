"""The tracker's model in the posture of an estimate."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.person import Joint
from enliven_edge.tracking.body_model import Posture, joint_limits, model
from enliven_edge.tracking.estimator import Estimate
from enliven_edge.tracking.fit import align

_WIDTH = 0.3
"""Metres beyond which a joint is doubted while the model is brought to it."""
_STEPS, _ANEW = 10, 20
"""Of the alignment of a posture that is near, and of one begun standing."""


def posed(estimate: Estimate, lengths: Float) -> Posture:
    """A posture whose joints are at the estimate's, of (12,) lengths, with no other posture to begin from."""
    start = Posture(estimate.joints[Joint.HIP_CENTER].copy(), joint_limits.RELAXED.copy(), lengths.copy())
    start.rotations[model.PELVIS] = _trunk(estimate.joints)
    return drawn(start, estimate, _ANEW)


def drawn(posture: Posture, estimate: Estimate, steps: int = _STEPS) -> Posture:
    """A posture brought to the estimate's joints, by how sure each is; its lengths kept."""
    weights = estimate.landmarks[:, 3]
    made, _ = align(
        posture,
        model.JOINT_FRAMES,
        model.JOINT_OFFSETS,
        estimate.joints,
        weights,
        width=_WIDTH,
        iterations=steps,
    )
    return made


def _trunk(joints: Float) -> Float:
    """(3, 3) the axes of a trunk whose hips and shoulders are these: left, up, ahead."""
    left = joints[Joint.SHOULDER_LEFT] - joints[Joint.SHOULDER_RIGHT]
    left = left + joints[Joint.HIP_LEFT] - joints[Joint.HIP_RIGHT]
    up = joints[Joint.SHOULDER_CENTER] - joints[Joint.HIP_CENTER]
    up = up / (np.linalg.norm(up) + 1e-9)
    left = left - (left @ up) * up
    left = left / (np.linalg.norm(left) + 1e-9)
    return np.stack([left, up, np.cross(left, up)], 1)
