"""Where the sensor stands: the floor plane, by RANSAC, with gravity roughly known from the mounting."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float

_STEEPEST = np.cos(np.deg2rad(40.0))
_LOWEST, _HIGHEST = 0.2, 4.0


def world_from_floor(points: Float, upside_down: bool = False, *, seed: int = 0) -> Float | None:
    """(4, 4) world_from_camera whose floor is the lowest large plane, or None where no floor is seen.

    The world's origin lies on the floor under the sensor, which looks along -Z.

    Args:
        points: (M, 3) camera-frame points, metres.
        upside_down: the sensor hangs upside down, so that the camera's -Y points to the floor.
    """
    up = np.array([0.0, 1.0 if upside_down else -1.0, 0.0])
    points = points[np.isfinite(points).all(1) & (points[:, 2] > 0.3)]
    if len(points) < 200:
        return None
    points = points[:: max(1, len(points) // 6000)]
    tolerance = 0.015 + 0.004 * points[:, 2] ** 2
    normal, height = _best_plane(points, tolerance, up, np.random.default_rng(seed))
    if normal is None:
        return None
    for _ in range(3):
        inliers = np.abs(points @ normal + height) < tolerance
        normal, height = _least_squares(points[inliers], up)
    return _pose(normal, height)


def _best_plane(
    points: Float, tolerance: Float, up: Float, random: np.random.Generator
) -> tuple[Float | None, float]:
    """The upward plane n.x + h = 0 with most inliers and next to nothing below it."""
    best, best_normal, best_height = 0.04 * len(points), None, 0.0
    for _ in range(400):
        a, b, c = points[random.choice(len(points), 3, replace=False)]
        normal = np.cross(b - a, c - a)
        length = float(np.linalg.norm(normal))
        if length < 1e-4:
            continue
        normal = normal / length * np.sign(normal @ up or 1.0)
        height = -float(normal @ a)
        if normal @ up < _STEEPEST or not _LOWEST < height < _HIGHEST:
            continue
        distance = points @ normal + height
        below = np.count_nonzero(distance < -3 * tolerance)
        score = float(np.count_nonzero(np.abs(distance) < tolerance) - 3 * below)
        if score > best:
            best, best_normal, best_height = score, normal, height
    return best_normal, best_height


def _least_squares(points: Float, up: Float) -> tuple[Float, float]:
    """The plane through (M, 3) points by principal components."""
    centre = points.mean(0)
    normal = np.linalg.svd(points - centre, full_matrices=False)[2][2]
    normal = normal * np.sign(normal @ up or 1.0)
    return normal, -float(normal @ centre)


def _pose(normal: Float, height: float) -> Float:
    """world_from_camera for a floor with this upward normal, ``height`` metres under the sensor."""
    backward = np.array([0.0, 0.0, -1.0])
    z = backward - (backward @ normal) * normal
    z /= np.linalg.norm(z)
    x = np.cross(normal, z)
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = np.stack([x, normal, z])
    world_from_camera[1, 3] = height
    return world_from_camera
