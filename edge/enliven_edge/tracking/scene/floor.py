"""Estimates the sensor's pose from the floor plane with RANSAC, given a rough direction of gravity."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.kernels import njit

MAX_FLOOR_TILT = np.deg2rad(40.0)
"""Maximum angle in radians between the floor's normal and the sensor's up direction. A wall deviates by 90
degrees if the sensor is level, and by 50 degrees if the sensor is tilted by 40.
"""
_MIN_SENSOR_HEIGHT_M = 0.2
"""Minimum height of the sensor above the floor in metres. A nearer plane is the sensor's support, such as a
table."""
_MAX_SENSOR_HEIGHT_M = 4.0
"""Maximum height of the sensor above the floor in metres. Sensors are mounted no higher."""
_TRIALS = 400
"""Number of RANSAC trials, planes through three points. If a tenth of the points is on the floor and half of
the triples are neighbours, at least one trial hits the floor with a probability of 99.9 %."""
_MAX_NEIGHBOUR_STEP = 0.05
"""Maximum index distance between the points of a neighbouring triple, as a fraction of the number of points
in image order: a few rows."""
_MIN_PLANE_POINTS = 200
"""Minimum number of points for a plane. Fewer are noise, or a corner of the floor."""


def world_from_floor(
    points: Float,
    upside_down: bool = False,
    *,
    up: Float | None = None,
    within: float = MAX_FLOOR_TILT,
    lowest: float = _MIN_SENSOR_HEIGHT_M,
    seed: int = 0,
) -> Float | None:
    """Returns (4, 4) world_from_camera with y = 0 in the lowest large plane, or None if no floor is visible.

    The world's origin lies on the floor under the sensor, which looks along -Z.

    Args:
        points: (M, 3) camera-frame points, metres, in the order of the image's rows.
        upside_down: whether the sensor hangs upside down, so that the camera's -Y points to the floor.
        up: (3,) the rough direction of up in the camera's frame, if it is known from a better source.
        within: maximum angle in radians between the floor's normal and ``up``.
        lowest: minimum height of the sensor above the floor in metres.
        seed: seed of the random triples. Another seed may find a floor that is a small part of the image.
    """
    up = np.array([0.0, 1.0 if upside_down else -1.0, 0.0]) if up is None else up
    points = points[np.isfinite(points).all(1) & (points[:, 2] > 0.3)]
    if len(points) < _MIN_PLANE_POINTS:
        return None
    points = np.ascontiguousarray(points[:: max(1, len(points) // 6000)])
    tolerance = 0.01 + 0.002 * points[:, 2] ** 2
    trials = _random_triples(len(points), np.random.default_rng(seed))
    plane = _best_plane(points, tolerance, up, np.cos(within), lowest, _MAX_SENSOR_HEIGHT_M, trials)
    if not plane.any():
        return None
    pose = raise_world_above_floor(plane[:3], float(plane[3]))
    level = np.ascontiguousarray((points @ pose[:3, :3].T + pose[:3, 3]).T)
    fitted, _ = fit_level_plane(level, np.ascontiguousarray(points[:, 2]))
    return _level_mounting(pose, fitted, 1.0)


def _random_triples(count: int, random: np.random.Generator) -> Int:
    """Returns (T, 3) indices of random points: half of the triples are arbitrary, half are neighbours.

    Neighbours mostly lie on one surface. They let RANSAC find a floor that is a small part of the image.
    """
    triples = random.integers(0, count, (_TRIALS, 3))
    reach = max(3, round(_MAX_NEIGHBOUR_STEP * count))
    neighbours = triples[::2, :1] + random.integers(-reach, reach + 1, (len(triples[::2]), 2))
    triples[::2, 1:] = np.clip(neighbours, 0, count - 1)
    return triples


@njit(cache=True, nogil=True)
def _best_plane(points, tolerance, up, steepest, lowest, highest, trials):
    """Returns (4,) coefficients n, h of the upward plane n.x + h = 0 with the most inliers and almost no
    points below.

    Zeros if there is no such plane.
    """
    best, plane = 0.04 * len(points), np.zeros(4)
    normal = np.empty(3)
    for trial in range(len(trials)):
        a, b, c = points[trials[trial, 0]], points[trials[trial, 1]], points[trials[trial, 2]]
        normal[0] = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
        normal[1] = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
        normal[2] = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        # Compute the plane through the three points. Skip points on a line, and planes that are too steep,
        # too near or too far.
        length = np.sqrt((normal**2).sum())
        if length < 1e-4:
            continue
        upward = (normal * up).sum()
        normal *= (1.0 if upward >= 0.0 else -1.0) / length
        height = -(normal * a).sum()
        if abs(upward) / length < steepest or not lowest < height < highest:
            continue
        # The score is the number of inliers minus three times the number of points below the plane, because a
        # floor has no points below it.
        on, below = 0, 0
        for i in range(len(points)):
            p = points[i]
            distance = p[0] * normal[0] + p[1] * normal[1] + p[2] * normal[2] + height
            on += abs(distance) < tolerance[i]
            below += distance < -3.0 * tolerance[i]
        if on - 3 * below > best:
            best = on - 3 * below
            plane[0], plane[1], plane[2], plane[3] = normal[0], normal[1], normal[2], height
    return plane


def raise_world_above_floor(normal: Float, height: float) -> Float:
    """Returns (4, 4) world_from_camera for a floor with the (3,) upward normal, ``height`` metres below the
    sensor.
    """
    backward = np.array([0.0, 0.0, -1.0])
    if abs(normal[2]) > 0.98:
        # The camera looks straight down or up, so the upward direction of the image points away from the
        # sensor.
        backward = np.array([0.0, 1.0, 0.0])
    z = backward - (backward @ normal) * normal
    z /= np.linalg.norm(z)
    x = np.cross(normal, z)
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = np.stack([x, normal, z])
    world_from_camera[1, 3] = height
    return world_from_camera


_FLOOR_BAND_M = 0.12
"""Maximum distance in metres from y = 0 of points that are used as the floor when the mounting is
corrected."""
_MAX_TILT = np.deg2rad(6.0)
"""Maximum apparent tilt of the floor in radians. A larger tilt is not caused by drift of the mounting, or the
plane is not the floor.
"""
_SIGMA_OF_MEDIAN = 1.4826
"""Standard deviation of a normal distribution divided by its median absolute deviation."""
_MAX_DEVIATIONS = 2.0
"""Maximum deviation of a floor point in standard deviations of the floor's noise. It excludes the lower edge
of a wall, which would raise the far end of the plane."""
_UNEVENNESS_M = 0.003
"""Unevenness of the floor itself in metres."""
_FIT_PASSES = 8
"""Number of fits. Each fit uses the inliers of the previous one. The inlier band converges after five
fits."""
_MAX_PLANE_DISTANCE_M = 0.08
"""Maximum distance in metres of floor points from the first plane."""
_FIT_POINTS = 2000
"""Approximate number of floor points for the plane fit. With all points, ten thousand or more, the frame with
the fit (one per second) took twice as long as the others."""
_MIN_SPREAD_M = 0.15
"""Minimum standard deviation in metres of the floor's points along x and along z. A narrower patch does not
constrain the tilt."""


def correct_mounting(world_from_camera: Float, points: Float, usable: Bool, gain: float) -> Float:
    """Returns the sensor's pose (4, 4), moved by a fraction of its deviation from the observed floor.

    The pose is unchanged if too little floor is visible.

    Args:
        world_from_camera: (4, 4) the current pose of the sensor.
        points: (h, w, 3) the points of a frame, world frame.
        usable: (h, w) known pixels that do not belong to a person.
        gain: the fraction of the correction that is applied, in (0, 1].
    """
    floor = points[usable & (np.abs(points[..., 1]) < _FLOOR_BAND_M)]
    if len(floor) < _MIN_PLANE_POINTS:
        return world_from_camera
    floor = floor[:: max(1, len(floor) // _FIT_POINTS)]
    ranges = (floor - world_from_camera[:3, 3]) @ world_from_camera[:3, 2]
    plane, spread = fit_level_plane(np.ascontiguousarray(floor.T), ranges)
    if spread < _MIN_SPREAD_M or np.hypot(plane[0], plane[1]) > np.tan(_MAX_TILT):
        return world_from_camera
    return _level_mounting(world_from_camera, plane, gain)


def _level_mounting(world_from_camera: Float, plane: Float, gain: float) -> Float:
    """Returns the sensor's (4, 4) pose, rotated and lifted by a fraction of its deviation from a floor plane.

    Args:
        plane: (3,) a, b, c of the floor y = a x + b z + c, in the world frame of the current pose.
        gain: the fraction, in (0, 1].
    """
    normal = np.array([-plane[0] * gain, 1.0, -plane[1] * gain])
    normal /= np.linalg.norm(normal)
    axis = np.cross(normal, [0.0, 1.0, 0.0])
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + cross + cross @ cross / (1.0 + normal[1])
    # Rotate about the point of the floor that is under the sensor, so that nothing shifts sideways.
    foot = np.array([world_from_camera[0, 3], 0.0, world_from_camera[2, 3]])
    levelled = world_from_camera.copy()
    levelled[:3, :3] = turn @ world_from_camera[:3, :3]
    levelled[:3, 3] = turn @ (world_from_camera[:3, 3] - foot) + foot
    levelled[0, 3], levelled[2, 3] = foot[0], foot[2]
    height = float(plane[0] * foot[0] + plane[1] * foot[2] + plane[2])
    levelled[1, 3] -= gain * height
    return levelled


@njit(cache=True, nogil=True)
def fit_level_plane(points, ranges):
    """Fits the plane y = a x + b z + c to the floor's points. Returns its (3,) coefficients and the points'
    spread.

    It is an iterative weighted least-squares fit. A sensor's noise is along its rays and grows with about the
    squared distance. Rays hit the floor at an angle that becomes flatter with distance. So the noise
    perpendicular to the floor is proportional to the distance. Each pass estimates the factor from the points
    themselves, by their median deviation.

    Args:
        points: (3, N) metres, in a frame in which the floor is nearly y = 0.
        ranges: (N,) metres from the sensor, along its axis.

    Returns:
        The plane, zeros if the points are too few or in a line. The spread is the smaller of the standard
            deviations of the used points along x and z in metres; 0 without a plane.
    """
    plane, off = np.zeros(3), np.empty(points.shape[1])
    kept, weights = np.empty_like(points), np.empty(points.shape[1])
    noise, spread = 0.0, 0.0
    for step in range(_FIT_PASSES):
        # Estimate the noise factor: the median deviation of the points near the current plane, relative to
        # their range.
        near = 0
        for i in range(points.shape[1]):
            off[i] = abs(points[1, i] - plane[0] * points[0, i] - plane[1] * points[2, i] - plane[2])
            if off[i] < (
                _MAX_PLANE_DISTANCE_M
                if step == 0
                else 1.5 * _MAX_DEVIATIONS * noise * ranges[i] + _UNEVENNESS_M
            ):
                weights[near] = off[i] / ranges[i]
                near += 1
        if near < _MIN_PLANE_POINTS:
            return np.zeros(3), 0.0
        noise = _SIGMA_OF_MEDIAN * np.median(weights[:near])
        # Fit a plane to the points within this noise of the plane. Far points weigh less, because
        # noise grows with the range.
        count = 0
        for i in range(points.shape[1]):
            if off[i] < _MAX_DEVIATIONS * noise * ranges[i] + _UNEVENNESS_M:
                weights[count] = 1.0 / (noise * ranges[i] + _UNEVENNESS_M) ** 2
                for a in range(3):
                    kept[a, count] = points[a, i]
                count += 1
        if count < _MIN_PLANE_POINTS or not _level_fit(plane, kept[:, :count], weights[:count]):
            return np.zeros(3), 0.0
        spread = min(kept[0, :count].std(), kept[2, :count].std())
    return plane, spread


@njit(cache=True, nogil=True)
def _level_fit(plane, points, weights):
    """Computes the weighted least-squares fit y = a x + b z + c of (3, N) points, into ``plane``.

    Returns False if the points are in a line.
    """
    whole = weights.sum()
    x, y, z = (
        (weights * points[0]).sum() / whole,
        (weights * points[1]).sum() / whole,
        (weights * points[2]).sum() / whole,
    )
    xx, xz, zz, xy, zy = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(points.shape[1]):
        dx, dy, dz = points[0, i] - x, points[1, i] - y, points[2, i] - z
        xx, xz, zz = xx + weights[i] * dx * dx, xz + weights[i] * dx * dz, zz + weights[i] * dz * dz
        xy, zy = xy + weights[i] * dx * dy, zy + weights[i] * dz * dy
    determinant = xx * zz - xz * xz
    if determinant <= 1e-12 * xx * zz:
        return False
    plane[0], plane[1] = (xy * zz - zy * xz) / determinant, (zy * xx - xy * xz) / determinant
    plane[2] = y - plane[0] * x - plane[1] * z
    return True
