"""Brings the tracker's model to the joints of the network's estimate."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.person import Joint
from enliven_edge.tracking.body_model import Posture, joint_limits, model
from enliven_edge.tracking.estimator import Estimate
from enliven_edge.tracking.fit import align

_WIDTH = 0.3
"""Metres beyond which a joint is doubted while the model is brought to it."""
_STEPS = 10
"""Steps of aligning a posture that is near."""
_STEPS_FROM_STANDING = 20
"""Steps of aligning a posture that begins relaxed: its limbs have farther to go."""


def posed(estimate: Estimate, lengths: Float) -> Posture:
    """Returns a posture of (12,) lengths with its joints at the estimate's, begun from standing relaxed."""
    start = Posture(estimate.joints[Joint.HIP_CENTER].copy(), joint_limits.RELAXED.copy(), lengths.copy())
    start.rotations[model.PELVIS] = _trunk(estimate.joints)
    return aligned_to(start, estimate, _STEPS_FROM_STANDING)


def aligned_to(posture: Posture, estimate: Estimate, steps: int = _STEPS) -> Posture:
    """Brings a posture to the estimate's joints, weighted by how sure each is; keeps its lengths."""
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
    """Returns the (3, 3) axes left, up and ahead, in columns, of the trunk between hips and shoulders."""
    left = joints[Joint.SHOULDER_LEFT] - joints[Joint.SHOULDER_RIGHT]
    left = left + joints[Joint.HIP_LEFT] - joints[Joint.HIP_RIGHT]
    up = joints[Joint.SHOULDER_CENTER] - joints[Joint.HIP_CENTER]
    up = up / (np.linalg.norm(up) + 1e-9)
    left = left - (left @ up) * up
    left = left / (np.linalg.norm(left) + 1e-9)
    return np.stack([left, up, np.cross(left, up)], 1)
