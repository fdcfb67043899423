"""Converts a performer's body to the bones of Unity's humanoid (kernels)."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven.person.joints import Joint

_HIP_CENTER, _SPINE = int(Joint.HIP_CENTER), int(Joint.SPINE)
_SHOULDER_CENTER, _HEAD = int(Joint.SHOULDER_CENTER), int(Joint.HEAD)
_SHOULDERS = (int(Joint.SHOULDER_LEFT), int(Joint.SHOULDER_RIGHT))
_COLLAR_FRACTION = 0.25
"""Position at which the collar bone begins, as a fraction of the way from the neck to the shoulder."""
_SKULL_FRACTION = 0.5
"""Position at which the head bone begins, as a fraction of the way from the neck to the middle of the
head."""


@njit(cache=True, nogil=True)
def write_human(joints, orientations, begins, ends, hanging, bones, positions, turns):
    """Computes the positions at which a performer's bones begin, and their rotations since the
    T-pose.

    Args:
        joints: (20, 3) metres. orientations: (20, 4) rotations of the bones that end at the joints.
        begins, ends: (B,) the joints at the ends of each bone.
        hanging: (B, 4) rotation from the T-pose to a standing person with hanging arms.
        bones: (7,) numbers of the hips, spine, chest, neck, head, left and right shoulder.
        positions: (B, 3) metres, output. turns: (B, 4) rotations, output.
    """
    for b in range(len(begins)):
        w, x, y, z = orientations[ends[b]]
        hw, hx, hy, hz = hanging[b]
        turns[b, 0] = w * hw - x * hx - y * hy - z * hz
        turns[b, 1] = w * hx + x * hw + y * hz - z * hy
        turns[b, 2] = w * hy - x * hz + y * hw + z * hx
        turns[b, 3] = w * hz + x * hy - y * hx + z * hw
        positions[b] = joints[begins[b]]
    # The humanoid has one bone more than the tracker in the trunk, and one more between chest and head. An
    # additional bone gets the rotation halfway between its neighbours.
    _write_middle_turn(turns[bones[0]], turns[bones[2]], turns[bones[1]])
    _write_middle_turn(turns[bones[2]], turns[bones[4]], turns[bones[3]])
    for k in range(3):
        neck = joints[_SHOULDER_CENTER, k]
        positions[bones[1], k] = 0.5 * (joints[_HIP_CENTER, k] + joints[_SPINE, k])
        positions[bones[4], k] = neck + _SKULL_FRACTION * (joints[_HEAD, k] - neck)
        for side in range(2):
            positions[bones[5 + side], k] = neck + _COLLAR_FRACTION * (joints[_SHOULDERS[side], k] - neck)


@njit(cache=True, nogil=True)
def _write_middle_turn(a, b, out):
    """Writes the rotation halfway between the unit quaternions a and b to ``out`` (4,).

    The sum of two unit vectors points to the middle of the arc between them. The function uses b or -b,
    whichever is nearer to a.
    """
    sign = -1.0 if a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] < 0.0 else 1.0
    length = 0.0
    for k in range(4):
        out[k] = a[k] + sign * b[k]
        length += out[k] * out[k]
    length = np.sqrt(length)
    for k in range(4):
        out[k] /= length
