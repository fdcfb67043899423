"""Basic operations on rigid poses (4, 4)."""

from __future__ import annotations

import numpy as np

from enliven import rotation
from enliven.arrays import Float


def cross_matrix(v: Float) -> Float:
    """Returns the cross product matrix (3, 3) of v."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def move_pose(pose: Float, step: Float) -> Float:
    """Returns the pose moved by a ``step`` (6,), in world axes: a translation (m), and a rotation vector
    (rad) about the position of the pose.
    """
    moved_pose = pose.copy()
    step_rotation = rotation.from_rotation_vector(step[3:])
    moved_pose[:3, :3] = rotation.nearest_rotation(rotation.to_matrix(step_rotation) @ pose[:3, :3])
    moved_pose[:3, 3] += step[:3]
    return moved_pose


def invert_pose(pose: Float) -> Float:
    """Returns the inverse (4, 4) of a rigid pose (4, 4)."""
    inverse = np.eye(4)
    inverse[:3, :3] = pose[:3, :3].T
    inverse[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return inverse


def pose_difference(first: Float, second: Float) -> tuple[float, float]:
    """Returns the distance in metres and the angle in radians between two poses."""
    rotation_vector = rotation.to_rotation_vector(rotation.from_matrix(first[:3, :3].T @ second[:3, :3]))
    return float(np.linalg.norm(second[:3, 3] - first[:3, 3])), float(np.linalg.norm(rotation_vector))


def interpolate_poses(first: Float, second: Float, fraction: float) -> Float:
    """Returns the pose (4, 4) interpolated between two poses, at a fraction from 0 (first) to 1 (second)."""
    rotation_vector = rotation.to_rotation_vector(rotation.from_matrix(second[:3, :3] @ first[:3, :3].T))
    return move_pose(
        first, np.concatenate([fraction * (second[:3, 3] - first[:3, 3]), fraction * rotation_vector])
    )
