"""Rigid transforms (4, 4): basic operations, and a weighted least squares fit to corresponding points."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.rotation import (
    from_matrix,
    from_rotation_vector,
    nearest_rotation,
    to_matrix,
    to_rotation_vector,
)

UP = np.array([0.0, 1.0, 0.0])
"""(3,) the vertical of the world, +Y."""


def transform_points(transform: Float, points: Float) -> Float:
    """Transforms points (..., 3) by a rigid transform (4, 4)."""
    return rotate_vectors(transform, points) + transform[:3, 3]


def rotate_vectors(transform: Float, vectors: Float) -> Float:
    """Rotates vectors (..., 3) by the rotation of a rigid transform (4, 4)."""
    # Compute one matrix product. For an array (N, 20, 3), NumPy would otherwise compute one product per (20,
    # 3) block.
    return np.asarray((vectors.reshape(-1, 3) @ transform[:3, :3].T).reshape(vectors.shape))


def invert(transform: Float) -> Float:
    """Returns the inverse transform (4, 4)."""
    inverse = np.eye(4)
    inverse[:3, :3] = transform[:3, :3].T
    inverse[:3, 3] = -transform[:3, :3].T @ transform[:3, 3]
    return inverse


def compose_transform(rotation: Float, translation: Float) -> Float:
    """Returns the transform (4, 4) of a rotation (3, 3) and a translation (3,)."""
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation, translation
    return transform


def rotation_from_vector(vector: Float) -> Float:
    """Returns the rotation (3, 3) by a rotation vector (3,), radians."""
    return to_matrix(from_rotation_vector(vector))


def cross_matrix(v: Float) -> Float:
    """Returns the matrix (3, 3) with cross_matrix(v) @ w == cross(v, w)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def angle_between(a: Float, b: Float) -> float:
    """Returns the angle in radians between the rotations of two transforms (or rotation matrices)."""
    return float(np.linalg.norm(rotation_vector(a[:3, :3].T @ b[:3, :3])))


def rotation_vector(rotation: Float) -> Float:
    """Returns the rotation vector (3,) of a (3, 3) rotation, angle in [0, pi]."""
    return to_rotation_vector(from_matrix(rotation))


def fit_rigid(source: Float, target: Float, weights: Float, *, upright: bool) -> Float:
    """Returns the rigid transform (4, 4) from source to target that minimises sum w |R s + t - d|^2 over
    points s and d (Kabsch 1976, Umeyama 1991).

    Args:
        source, target: (N, 3) corresponding points, metres.
        weights: (N,) at least 0, not all 0.
        upright: True allows only rotation about +Y.
    """
    normalised_weights = weights / weights.sum()
    from_centre, to_centre = normalised_weights @ source, normalised_weights @ target
    covariance = (source - from_centre).T @ (normalised_weights[:, None] * (target - to_centre))
    rotation = _fit_rotation_about_up(covariance) if upright else nearest_rotation(covariance.T)
    return compose_transform(rotation, to_centre - rotation @ from_centre)


def _fit_rotation_about_up(covariance: Float) -> Float:
    """Returns the rotation (3, 3) about +Y that best fits a cross-covariance matrix."""
    angle = np.arctan2(covariance[2, 0] - covariance[0, 2], covariance[0, 0] + covariance[2, 2])
    return rotation_from_vector(angle * UP)
