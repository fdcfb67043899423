"""The sensor's pose from the floor plane, by RANSAC; gravity is roughly known from the mounting."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.kernels import njit

_WITHIN = np.deg2rad(40.0)
"""Radians between the floor's normal and the sensor's up at most: a wall is 90 degrees off a level sensor,
and still 50 off one that is tilted by 40."""
_LOWEST = 0.2
"""Metres from the sensor down to the floor at the least: a nearer plane is what the sensor stands on."""
_HIGHEST = 4.0
"""Metres from the sensor down to the floor at the most: sensors are mounted no higher."""
_LYING_LOWEST = 0.03
"""Metres down to the floor at the least for a sensor that was knocked over and may lie on it."""
_TRIALS = 400
"""Planes through three random points that are tried: where a quarter of the points are the floor's, one of
the planes is with a probability of 99.8 %."""
_FEWEST = 200
"""Points at the least for a plane: fewer are noise, or a corner of the floor."""


def world_from_floor(
    points: Float,
    upside_down: bool = False,
    *,
    up: Float | None = None,
    within: float = _WITHIN,
    seed: int = 0,
) -> Float | None:
    """(4, 4) world_from_camera with y = 0 in the lowest large plane, or None where no floor is seen.

    The world's origin lies on the floor under the sensor, which looks along -Z.

    Args:
        points: (M, 3) camera-frame points, metres.
        upside_down: the sensor hangs upside down, so that the camera's -Y points to the floor.
        up: (3,) the rough direction of up in the camera's frame, where that is known better.
        within: radians between the floor's normal and ``up`` at most.
    """
    lowest = _LOWEST if up is None else _LYING_LOWEST
    up = np.array([0.0, 1.0 if upside_down else -1.0, 0.0]) if up is None else up
    points = points[np.isfinite(points).all(1) & (points[:, 2] > 0.3)]
    if len(points) < _FEWEST:
        return None
    points = np.ascontiguousarray(points[:: max(1, len(points) // 6000)])
    tolerance = 0.015 + 0.004 * points[:, 2] ** 2
    trials = np.random.default_rng(seed).integers(0, len(points), (_TRIALS, 3))
    plane = _best_plane(points, tolerance, up, np.cos(within), lowest, _HIGHEST, trials)
    if not plane.any():
        return None
    normal, height = plane[:3], float(plane[3])
    for _ in range(3):
        inliers = np.abs(points @ normal + height) < tolerance
        normal, height = _least_squares(points[inliers], up)
    return _pose(normal, height)


@njit(cache=True, nogil=True)
def _best_plane(points, tolerance, up, steepest, lowest, highest, trials):  # type: ignore[no-untyped-def]
    """(4,) the upward plane n.x + h = 0 with most inliers and next to nothing below it; zeros for none."""
    best, found = 0.04 * len(points), np.zeros(4)
    normal = np.empty(3)
    for trial in range(len(trials)):
        a, b, c = points[trials[trial, 0]], points[trials[trial, 1]], points[trials[trial, 2]]
        normal[0] = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
        normal[1] = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
        normal[2] = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        length = np.sqrt((normal**2).sum())
        if length < 1e-4:
            continue
        upward = (normal * up).sum()
        normal *= (1.0 if upward >= 0.0 else -1.0) / length
        height = -(normal * a).sum()
        if abs(upward) / length < steepest or not lowest < height < highest:
            continue
        on, below = 0, 0
        for i in range(len(points)):
            p = points[i]
            distance = p[0] * normal[0] + p[1] * normal[1] + p[2] * normal[2] + height
            on += abs(distance) < tolerance[i]
            below += distance < -3.0 * tolerance[i]
        if on - 3 * below > best:
            best = on - 3 * below
            found[0], found[1], found[2], found[3] = normal[0], normal[1], normal[2], height
    return found


def _least_squares(points: Float, up: Float) -> tuple[Float, float]:
    """The plane through (M, 3) points by principal components."""
    centre = points.mean(0)
    normal = np.linalg.svd(points - centre, full_matrices=False)[2][2]
    normal = normal * np.sign(normal @ up or 1.0)
    return normal, -float(normal @ centre)


def _pose(normal: Float, height: float) -> Float:
    """world_from_camera for a floor with this upward normal, ``height`` metres under the sensor."""
    backward = np.array([0.0, 0.0, -1.0])
    if abs(normal[2]) > 0.98:  # looking straight down or up: the image's own up is away
        backward = np.array([0.0, 1.0, 0.0])
    z = backward - (backward @ normal) * normal
    z /= np.linalg.norm(z)
    x = np.cross(normal, z)
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = np.stack([x, normal, z])
    world_from_camera[1, 3] = height
    return world_from_camera


_NEAR_FLOOR = 0.12
"""Metres above and below y = 0 within which a point may be the floor's when the mounting is corrected."""
_STEADY = np.deg2rad(6.0)
"""Radians by which the floor may seem tilted: a larger tilt is no drift of the mounting, or no floor."""
_WIDTHS = (0.08, 0.05, 0.04)
"""Metres from the plane beyond which points are left out of the next fit."""
_SPREAD = 0.15
"""Metres, the least standard deviation of the floor's points along x and along z: a narrower patch says
little of the tilt."""


def corrected(world_from_camera: Float, points: Float, usable: Bool, gain: float) -> Float:
    """(4, 4) the mounting moved a little towards the seen floor; unchanged where too little of it is seen.

    Args:
        points: (h, w, 3) a frame, world frame.
        usable: (h, w) known pixels that belong to no person.
        gain: the share of the correction that is applied, in (0, 1].
    """
    plane, seen = _lying_plane(points, usable)
    if not seen or np.hypot(plane[0], plane[1]) > np.tan(_STEADY):
        return world_from_camera
    normal = np.array([-plane[0] * gain, 1.0, -plane[1] * gain])
    normal /= np.linalg.norm(normal)
    axis = np.cross(normal, [0.0, 1.0, 0.0])
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + cross + cross @ cross / (1.0 + normal[1])
    # The turn is about the point of the floor under the sensor, so that nothing shifts sideways.
    foot = np.array([world_from_camera[0, 3], 0.0, world_from_camera[2, 3]])
    made = world_from_camera.copy()
    made[:3, :3] = turn @ world_from_camera[:3, :3]
    made[:3, 3] = turn @ (world_from_camera[:3, 3] - foot) + foot
    made[0, 3], made[2, 3] = foot[0], foot[2]
    height = float(plane[0] * foot[0] + plane[1] * foot[2] + plane[2])
    made[1, 3] -= gain * height
    return made


@njit(cache=True, nogil=True)
def _lying_plane(points, usable):  # type: ignore[no-untyped-def]
    """(3,) a, b, c of the plane y = a x + b z + c through the floor's points; whether enough of it is seen.

    Args:
        points, usable: see :func:`corrected`.
    """
    floor, count = np.empty((3, np.count_nonzero(usable))), 0
    for v in range(usable.shape[0]):
        for u in range(usable.shape[1]):
            if usable[v, u] and abs(points[v, u, 1]) < _NEAR_FLOOR:
                for a in range(3):
                    floor[a, count] = points[v, u, a]
                count += 1
    plane, spread = np.zeros(3), 0.0
    for width in _WIDTHS:
        if count < _FEWEST or not _level_fit(plane, floor[:, :count]):
            return plane, False
        left = 0
        for i in range(count):
            if abs(floor[1, i] - plane[0] * floor[0, i] - plane[1] * floor[2, i] - plane[2]) < width:
                for a in range(3):
                    floor[a, left] = floor[a, i]
                left += 1
        count = left
    if count > 0:
        spread = min(floor[0, :count].std(), floor[2, :count].std())
    return plane, spread >= _SPREAD


@njit(cache=True, nogil=True)
def _level_fit(plane, points):  # type: ignore[no-untyped-def]
    """The least-squares y = a x + b z + c of (3, N) points, into (3,) ``plane``; False: in a line."""
    x, y, z = points[0].mean(), points[1].mean(), points[2].mean()
    xx, xz, zz, xy, zy = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(points.shape[1]):
        dx, dy, dz = points[0, i] - x, points[1, i] - y, points[2, i] - z
        xx, xz, zz = xx + dx * dx, xz + dx * dz, zz + dz * dz
        xy, zy = xy + dx * dy, zy + dz * dy
    determinant = xx * zz - xz * xz
    if determinant <= 1e-12 * xx * zz:
        return False
    plane[0], plane[1] = (xy * zz - zy * xz) / determinant, (zy * xx - xy * xz) / determinant
    plane[2] = y - plane[0] * x - plane[1] * z
    return True
