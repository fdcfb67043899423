"""Detects walls in a blob of pixels: the background of a person while the background model is unknown."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.kernels import njit, quantile
from enliven.masks import pixels_of
from enliven_edge.tracking.frame.observation import FrameView

_TRIALS = 150
"""Number of RANSAC trials, lines through two random points seen from above. If a fifth of the points is on a
wall, at least one line follows the wall with a probability of 99.8 %.
"""
_SAMPLES = 1500
"""Approximate number of points for evaluating a line. The cost of a trial grows with them."""
_MAX_WALLS = 4
"""Maximum number of walls removed from one blob. A room has four."""
_MIN_WALL_AREA_M2 = 0.9
"""Minimum visible area of a wall in square metres. An upright plane of this size is not a person."""
_MIN_WALL_WIDTH_M = 0.9
"""Minimum width of a wall in metres. An upright plane of this width is not a person."""
_MIN_OCCUPIED = 0.8
"""Minimum fraction of occupied cells along a wall. It excludes two separate people, because they leave a
gap."""
_CELL_M = 0.15
"""Width of a cell along a wall in metres. It is smaller than the gap between two people."""
_WALL_TOLERANCE_M = 0.03
"""Maximum distance in metres of a wall's points from its plane, at the sensor. Walls are not quite flat."""
_TOLERANCE_GROWTH = 0.006
"""Increase of ``_WALL_TOLERANCE_M`` with the squared depth, in 1/metres, like a depth sensor's noise."""
_MIN_POINT_DISTANCE_M = 0.3
"""Minimum distance in metres between the two random points of a line. Closer points give no reliable
direction.
"""


def remove_walls(view: FrameView, mask: Bool, seed: int = 0) -> Bool:
    """Returns the (h, w) mask without its large upright planes (RANSAC). Without such planes it is
    unchanged.
    """
    pixels = pixels_of(mask)
    pixel = 1.0 / (view.camera.intrinsics.fx * view.camera.intrinsics.fy)
    random = np.random.default_rng(seed)
    plan, squares = _project_to_plan(view.points, view.z, pixels)
    for _ in range(_MAX_WALLS):
        if squares * pixel < _MIN_WALL_AREA_M2:
            break
        step = max(1, len(pixels) // _SAMPLES)
        sampled = np.ascontiguousarray(plan[:2, ::step].T)
        deep = np.ascontiguousarray(plan[2, ::step])
        pairs = random.integers(0, len(sampled), (_TRIALS, 2))
        line = find_best_line(sampled, _plane_tolerance(deep), deep * deep * pixel * step, pairs)
        is_on_line, coordinates, flat = _points_on_plane(plan, line)
        if not line.any() or flat * pixel < _MIN_WALL_AREA_M2 or not _is_wall(coordinates):
            break
        rest = np.flatnonzero(~is_on_line)
        pixels, plan, squares = pixels[rest], plan.take(rest, axis=1), squares - flat
    remaining = np.zeros(mask.shape, bool)
    remaining.ravel()[pixels] = True
    return remaining


@njit(cache=True, nogil=True)
def _project_to_plan(points, z, pixels):
    """Returns (3, N) world x, world z and depth of the pixels, and the sum of their squared depths.

    Args:
        points: (h, w, 3) metres, world frame.
        z: (h, w) metres.
        pixels: (N,) flat pixel indices.
    """
    points, z = points.reshape(-1, 3), z.ravel()
    out, squares = np.empty((3, len(pixels))), 0.0
    for n in range(len(pixels)):
        i = pixels[n]
        out[0, n], out[1, n], out[2, n] = points[i, 0], points[i, 2], z[i]
        squares += z[i] * z[i]
    return out, squares


@njit(cache=True, nogil=True)
def _points_on_plane(seen, line):
    """Returns (N,) whether each point lies on the vertical plane through a line.

    It also returns the coordinates of these points along the line in metres, and the sum of their squared
    depths.

    Args:
        seen: as returned by :func:`_project_to_plan`.
        line: as returned by :func:`find_best_line`.
    """
    on, along = np.empty(seen.shape[1], np.bool_), np.empty(seen.shape[1])
    count, squares = 0, 0.0
    for n in range(len(on)):
        x, z, deep = seen[0, n], seen[1, n], seen[2, n]
        on[n] = abs(x * line[0] + z * line[1] + line[2]) < _WALL_TOLERANCE_M + _TOLERANCE_GROWTH * deep * deep
        # Write every point without a branch. If this point is not on the plane, the next point overwrites its
        # value.
        along[count] = z * line[0] - x * line[1]
        count += on[n]
        squares += deep * deep if on[n] else 0.0
    return on, along[:count], squares


def _is_wall(along: Float) -> bool:
    """Returns True if points with the coordinates ``along`` a line, in metres, form one long stretch.

    The test excludes two separate people, because they leave a gap.
    """
    ordered = np.sort(along)
    low, high = quantile(ordered, 0.02), quantile(ordered, 0.98)
    if high - low <= _MIN_WALL_WIDTH_M:
        return False
    counts = np.diff(np.searchsorted(ordered, np.arange(low, high + _CELL_M, _CELL_M)))
    return bool(np.mean(counts > 0.25 * counts.mean()) > _MIN_OCCUPIED)


def _plane_tolerance(z: Float) -> Float:
    """Returns the maximum distance (N,) in metres from a wall's plane for points at each of (N,) depths."""
    return np.asarray(_WALL_TOLERANCE_M + _TOLERANCE_GROWTH * z * z)


@njit(cache=True, nogil=True, fastmath=True)
def find_best_line(points, thickness, weight, pairs):
    """Returns (3,) the line a x + b z + c = 0 through two of the (N, 2) points with the heaviest inliers."""
    best, line = 0.0, np.zeros(3)
    x, z = points[:, 0].copy(), points[:, 1].copy()
    for trial in range(len(pairs)):
        p, q = points[pairs[trial, 0]], points[pairs[trial, 1]]
        dx, dz = q[0] - p[0], q[1] - p[1]
        length = np.sqrt(dx * dx + dz * dz)
        if length < _MIN_POINT_DISTANCE_M:
            continue
        a, b = -dz / length, dx / length
        c = -(a * p[0] + b * p[1])
        on = 0.0
        for i in range(len(x)):
            # Add without a branch, so that the compiler can vectorise the loop.
            on += weight[i] if abs(a * x[i] + b * z[i] + c) < thickness[i] else 0.0
        if on > best:
            best = on
            line[0], line[1], line[2] = a, b, c
    return line
