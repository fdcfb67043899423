"""The sensor's pose from the floor plane, by RANSAC; gravity is roughly known from the mounting."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.kernels import njit

TILTED_BY = np.deg2rad(40.0)
"""Radians between the floor's normal and the sensor's up at most: a wall is 90 degrees off a level sensor,
and still 50 off one that is tilted by 40."""
_LOWEST = 0.2
"""Metres from the sensor down to the floor at the least: a nearer plane is what the sensor stands on."""
_HIGHEST = 4.0
"""Metres from the sensor down to the floor at the most: sensors are mounted no higher."""
_TRIALS = 400
"""Planes through three points that are tried: where a tenth of the points are the floor's, and half of the
triples are of neighbours, one of the planes is the floor's with a probability of 99.9 %."""
_NEIGHBOURS = 0.05
"""Share of all points, in the order of the image, within which the triples of neighbours lie: some rows."""
_FEWEST = 200
"""Points at the least for a plane: fewer are noise, or a corner of the floor."""


def world_from_floor(
    points: Float,
    upside_down: bool = False,
    *,
    up: Float | None = None,
    within: float = TILTED_BY,
    lowest: float = _LOWEST,
    seed: int = 0,
) -> Float | None:
    """(4, 4) world_from_camera with y = 0 in the lowest large plane, or None where no floor is seen.

    The world's origin lies on the floor under the sensor, which looks along -Z.

    Args:
        points: (M, 3) camera-frame points, metres, in the order of the image's rows.
        upside_down: the sensor hangs upside down, so that the camera's -Y points to the floor.
        up: (3,) the rough direction of up in the camera's frame, where that is known better.
        within: radians between the floor's normal and ``up`` at most.
        lowest: metres from the sensor down to the floor at the least.
        seed: of the random triples; another one may find a floor that is a small part of the image.
    """
    up = np.array([0.0, 1.0 if upside_down else -1.0, 0.0]) if up is None else up
    points = points[np.isfinite(points).all(1) & (points[:, 2] > 0.3)]
    if len(points) < _FEWEST:
        return None
    points = np.ascontiguousarray(points[:: max(1, len(points) // 6000)])
    tolerance = 0.01 + 0.002 * points[:, 2] ** 2
    trials = _triples(len(points), np.random.default_rng(seed))
    plane = _best_plane(points, tolerance, up, np.cos(within), lowest, _HIGHEST, trials)
    if not plane.any():
        return None
    found = world_above_floor(plane[:3], float(plane[3]))
    level = np.ascontiguousarray((points @ found[:3, :3].T + found[:3, 3]).T)
    fitted, _ = _level_plane(level, np.ascontiguousarray(points[:, 2]))
    return _levelled(found, fitted, 1.0)


def _triples(count: int, random: np.random.Generator) -> Int:
    """(T, 3) random points by index: half of the triples anywhere, half of neighbours.

    Neighbours are mostly of one surface, so that a floor that is a small part of the image is met as well.
    """
    triples = random.integers(0, count, (_TRIALS, 3))
    reach = max(3, round(_NEIGHBOURS * count))
    near = triples[::2, :1] + random.integers(-reach, reach + 1, (len(triples[::2]), 2))
    triples[::2, 1:] = np.clip(near, 0, count - 1)
    return triples


@njit(cache=True, nogil=True)
def _best_plane(points, tolerance, up, steepest, lowest, highest, trials):
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


def world_above_floor(normal: Float, height: float) -> Float:
    """(4, 4) world_from_camera for a floor with a (3,) upward normal, ``height`` metres under the sensor."""
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
_SIGMA_OF_MEDIAN = 1.4826
"""Standard deviation of a normal distribution over the median of its absolute values."""
_NOISES = 2.0
"""Standard deviations of the floor's own noise beyond which a point is left out: the foot of a wall, which
pulls a wider band up at its far end, is hardly within it."""
_UNEVEN = 0.003
"""Metres that a floor is uneven itself."""
_PASSES = 8
"""Fits, each to what lies near the one before: the band has its width after five."""
_FARTHEST_OFF = 0.08
"""Metres from the first plane beyond which nothing is the floor's."""
_MANY = 2000
"""Points of the floor to which its plane is fitted, about: with all of them, ten thousand and more, a frame
of each second took twice as long as the others."""
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
    floor = points[usable & (np.abs(points[..., 1]) < _NEAR_FLOOR)]
    if len(floor) < _FEWEST:
        return world_from_camera
    floor = floor[:: max(1, len(floor) // _MANY)]
    ranges = (floor - world_from_camera[:3, 3]) @ world_from_camera[:3, 2]
    plane, spread = _level_plane(np.ascontiguousarray(floor.T), ranges)
    if spread < _SPREAD or np.hypot(plane[0], plane[1]) > np.tan(_STEADY):
        return world_from_camera
    return _levelled(world_from_camera, plane, gain)


def _levelled(world_from_camera: Float, plane: Float, gain: float) -> Float:
    """(4, 4) a mounting turned about the point under the sensor, and lifted, by a share of what a plane says.

    Args:
        plane: (3,) a, b, c of the floor y = a x + b z + c in the world that the mounting gives.
        gain: the share, in (0, 1].
    """
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
def _level_plane(points, ranges):
    """(3,) a, b, c of the plane y = a x + b z + c through the floor's points, and how far these spread.

    A sensor's noise is along its rays, in proportion to about the squared distance; a floor is met at a
    grazing angle, the more so the farther, so that across it the noise is in proportion to the distance.
    Its factor is read off the points themselves, by the median of what they are off, in each pass.

    Args:
        points: (3, N) metres, in a frame in which the floor is nearly y = 0.
        ranges: (N,) metres from the sensor, along its axis.

    Returns:
        The plane, zeros where the points are too few or in a line, and metres: the smaller of the standard
        deviations along x and z of the points that it was fitted to, 0 where there is no plane.
    """
    plane, off = np.zeros(3), np.empty(points.shape[1])
    kept, weights = np.empty_like(points), np.empty(points.shape[1])
    noise, spread = 0.0, 0.0
    for step in range(_PASSES):
        near = 0
        for i in range(points.shape[1]):
            off[i] = abs(points[1, i] - plane[0] * points[0, i] - plane[1] * points[2, i] - plane[2])
            if off[i] < (_FARTHEST_OFF if step == 0 else 1.5 * _NOISES * noise * ranges[i] + _UNEVEN):
                weights[near] = off[i] / ranges[i]
                near += 1
        if near < _FEWEST:
            return np.zeros(3), 0.0
        noise = _SIGMA_OF_MEDIAN * np.median(weights[:near])
        count = 0
        for i in range(points.shape[1]):
            if off[i] < _NOISES * noise * ranges[i] + _UNEVEN:
                weights[count] = 1.0 / (noise * ranges[i] + _UNEVEN) ** 2
                for a in range(3):
                    kept[a, count] = points[a, i]
                count += 1
        if count < _FEWEST or not _level_fit(plane, kept[:, :count], weights[:count]):
            return np.zeros(3), 0.0
        spread = min(kept[0, :count].std(), kept[2, :count].std())
    return plane, spread


@njit(cache=True, nogil=True)
def _level_fit(plane, points, weights):
    """The weighted least-squares y = a x + b z + c of (3, N) points, into ``plane``; False: in a line."""
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
