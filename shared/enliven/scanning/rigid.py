"""Basic operations on rigid poses, (4, 4) each."""

from __future__ import annotations

import numpy as np

from enliven import rotation
from enliven.arrays import Float


def cross_matrix(v: Float) -> Float:
    """Returns (3, 3) the cross product matrix of v."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def move_pose(pose: Float, step: Float) -> Float:
    """Returns the pose after a ``step`` (6,): a translation (m) and a rotation (rad) about its own position,
    in world axes.
    """
    out = pose.copy()
    turn = rotation.from_rotation_vector(step[3:])
    out[:3, :3] = rotation.nearest_rotation(rotation.to_matrix(turn) @ pose[:3, :3])
    out[:3, 3] += step[:3]
    return out


def invert_pose(pose: Float) -> Float:
    """Returns the inverse of a pose."""
    out = np.eye(4)
    out[:3, :3] = pose[:3, :3].T
    out[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return out


def pose_difference(first: Float, second: Float) -> tuple[float, float]:
    """Returns the distance in metres and the angle in radians between two poses."""
    turn = rotation.to_rotation_vector(rotation.from_matrix(first[:3, :3].T @ second[:3, :3]))
    return float(np.linalg.norm(second[:3, 3] - first[:3, 3])), float(np.linalg.norm(turn))


def interpolate_poses(first: Float, second: Float, fraction: float) -> Float:
    """Returns the pose interpolated between two poses, at a fraction from 0 to 1."""
    turn = rotation.to_rotation_vector(rotation.from_matrix(second[:3, :3] @ first[:3, :3].T))
    return move_pose(first, np.concatenate([fraction * (second[:3, 3] - first[:3, 3]), fraction * turn]))
