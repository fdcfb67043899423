"""Joint limits: the range of each joint of a person, and a relaxed standing posture.

A range is a box of rotation vectors, relative to the rotation in the middle of the joint's range. In the
middle of a shoulder's range, the arm points sideways and forward. Hanging and overhead arms are both within a
third of a turn from there. So the logarithm of the rotation is smooth for all postures of a performer.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.posture import rotation

_SIDE = np.diag([-1.0, 1.0, 1.0])
"""(3, 3) reflection of the x axis. It exchanges left and right."""
_EXTRA_HIP_FLEXION = 0.4
"""Additional hip flexion in radians for a person who is already tracked. It allows 138 degrees relative to a
level pelvis."""
_NO_LIMIT = 10.0
"""Half width in radians of an unlimited range. It is larger than any rotation vector."""


def mirror_rotations(rotations: Float) -> Float:
    """Returns the mirrored posture (13, 3, 3): left and right exchanged, x reversed."""
    return _SIDE @ rotations[model.MIRROR] @ _SIDE


def _range_middles() -> Float:
    """Returns the middle (13, 3, 3) of every range."""
    middle = np.tile(np.eye(3), (13, 1, 1))
    middle[model.CHEST] = rotation(x=0.2)
    middle[model.UPPER_ARM_L] = rotation(x=-0.6, z=1.2)
    middle[model.THIGH_L] = rotation(x=-0.5, z=0.6)
    middle[model.FOREARM_L] = rotation(x=-1.25)
    middle[model.SHIN_L] = rotation(x=1.15)
    middle[model.FOOT_L] = rotation(x=0.2)
    return _with_right_side(middle)


def _with_right_side(rotations: Float) -> Float:
    """Sets the right limbs' rotations to the mirrored left ones, in place, and returns all rotations (13, 3,
    3).
    """
    mirror = mirror_rotations(rotations)
    for right in (model.UPPER_ARM_R, model.FOREARM_R, model.THIGH_R, model.SHIN_R, model.FOOT_R):
        rotations[right] = mirror[right]
    return rotations


def _range_half_widths() -> Float:
    """Returns (13, 3) half widths of the ranges in radians."""
    reach = np.full((13, 3), _NO_LIMIT)
    reach[model.CHEST] = (0.7, 0.75, 0.6)
    reach[model.HEAD] = (0.8, 1.2, 0.6)
    for limb, half in (
        (model.UPPER_ARM_L, (1.9, 1.3, 1.7)),
        (model.FOREARM_L, (1.3, _NO_LIMIT, _NO_LIMIT)),
        (model.THIGH_L, (1.5, 0.7, 1.25)),
        (model.SHIN_L, (1.2, _NO_LIMIT, _NO_LIMIT)),
        (model.FOOT_L, (0.6, _NO_LIMIT, _NO_LIMIT)),
    ):
        reach[limb] = reach[model.MIRROR[limb]] = half
    return reach


MIDDLE = _range_middles()
"""(13, 3, 3) the middle of each range, parent_from_frame."""
HALF_RANGES = _range_half_widths()
"""(13, 3) radians, half the width of each range about its middle."""


def _wide_hip_limits() -> tuple[Float, Float]:
    """Returns the middles and the half widths of ranges in which only the hips bend farther."""
    middle, reach = MIDDLE.copy(), HALF_RANGES.copy()
    middle[model.THIGH_L] = rotation(x=-0.5 - 0.5 * _EXTRA_HIP_FLEXION, z=0.6)
    reach[[model.THIGH_L, model.THIGH_R], 0] += 0.5 * _EXTRA_HIP_FLEXION
    return _with_right_side(middle), reach


WIDE_HIP_LIMITS = _wide_hip_limits()
"""(13, 3, 3) middles and (13, 3) half widths of the ranges of a person who is already tracked, see
:class:`Fitter`."""


def standing_pose(
    yaw: float = 0.0,
    *,
    arm_raise: float = 0.12,
    arm_forward: float = 0.0,
    elbow: float = 0.15,
    hip: float = 0.0,
    knee: float = 0.05,
) -> Float:
    """Returns (13, 3, 3) rotations of a standing person who faces +Z, turned by ``yaw`` about the vertical.

    Args:
        yaw: radians about +Y.
        arm_raise: sideways elevation of both upper arms from hanging, radians.
        arm_forward: forward elevation of both upper arms, radians.
        elbow: flexion of both elbows, radians.
        hip: forward elevation of both thighs, radians.
        knee: flexion of both knees, radians.
    """
    rotations = np.tile(np.eye(3), (13, 1, 1))
    rotations[model.PELVIS] = rotation(y=yaw)
    rotations[model.UPPER_ARM_L] = rotation(x=-arm_forward, z=arm_raise)
    rotations[model.FOREARM_L] = rotation(x=-elbow)
    rotations[model.THIGH_L] = rotation(x=-hip, z=0.06)
    rotations[model.SHIN_L] = rotation(x=knee)
    return _with_right_side(rotations)


RELAXED = standing_pose()
"""(13, 3, 3) rotations of a relaxed standing person who faces +Z. Copy it before you change it."""
