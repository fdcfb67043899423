"""Walls in a group of pixels: the background of a person while the room is not known yet."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.kernels import njit, quantile
from enliven.masks import pixels_of
from enliven_edge.tracking.frame import FrameView

_TRIALS = 150
"""Lines through two random points that are tried: with a fifth of the points on a wall, one of the lines lies
along it with a probability of 99.8 %."""
_SAMPLES = 1500
"""Points on which each line is tried, about: the cost of a trial grows with them."""
_MOST_WALLS = 4
"""Walls that are taken out of one group at most: a room has four."""
_AREA = 0.9
"""Square metres that are seen of a wall at the least: an upright plane of this size is no person."""
_LENGTH = 0.9
"""Metres across a wall at the least: an upright plane of this width is no person."""
_FILLED = 0.8
"""Share of the cells along a wall that must be met: two people who stand apart leave a gap."""
_BIN = 0.15
"""Metres of such a cell: less than the gap between two people."""
_THICK = 0.03
"""Metres off its plane within which a point is a wall's, at the sensor: walls are not quite flat."""
_THICKER = 0.006
"""Metres by which that grows with each square metre of depth, as a depth sensor's noise does."""
_APART = 0.3
"""Metres between the two points of a line at the least: nearer ones give no direction."""


def without_walls(view: FrameView, mask: Bool, seed: int = 0) -> Bool:
    """The (h, w) mask without its large upright planes; the mask itself where there are none."""
    pixels = pixels_of(mask)
    pixel = 1.0 / (view.camera.intrinsics.fx * view.camera.intrinsics.fy)
    random = np.random.default_rng(seed)
    seen, squares = _seen_from_above(view.points, view.z, pixels)
    for _ in range(_MOST_WALLS):
        if squares * pixel < _AREA:
            break
        step = max(1, len(pixels) // _SAMPLES)
        some = np.ascontiguousarray(seen[:2, ::step].T)
        deep = np.ascontiguousarray(seen[2, ::step])
        pairs = random.integers(0, len(some), (_TRIALS, 2))
        line = _best_line(some, _thickness(deep), deep * deep * pixel * step, pairs)
        on, along, flat = _lying_on(seen, line)
        if not line.any() or flat * pixel < _AREA or not _is_wall(along):
            break
        rest = np.flatnonzero(~on)
        pixels, seen, squares = pixels[rest], seen.take(rest, axis=1), squares - flat
    left = np.zeros(mask.shape, bool)
    left.ravel()[pixels] = True
    return left


@njit(cache=True, nogil=True)
def _seen_from_above(points, z, pixels):
    """(3, N) x and z in the world, and the depth, of (N,) places; the sum of the depths' squares.

    Args:
        points: (h, w, 3) metres, world frame.
        z: (h, w) metres.
    """
    points, z = points.reshape(-1, 3), z.ravel()
    out, squares = np.empty((3, len(pixels))), 0.0
    for n in range(len(pixels)):
        i = pixels[n]
        out[0, n], out[1, n], out[2, n] = points[i, 0], points[i, 2], z[i]
        squares += z[i] * z[i]
    return out, squares


@njit(cache=True, nogil=True)
def _lying_on(seen, line):
    """(N,) whether each point lies on the plane over a line; of those that do, metres along it and sum z^2.

    Args:
        seen: as of :func:`_seen_from_above`.
        line: as of :func:`_best_line`.
    """
    on, along = np.empty(seen.shape[1], np.bool_), np.empty(seen.shape[1])
    count, squares = 0, 0.0
    for n in range(len(on)):
        x, z, deep = seen[0, n], seen[1, n], seen[2, n]
        on[n] = abs(x * line[0] + z * line[1] + line[2]) < _THICK + _THICKER * deep * deep
        # Written without asking, and overwritten by the next one unless it lies there.
        along[count] = z * line[0] - x * line[1]
        count += on[n]
        squares += deep * deep if on[n] else 0.0
    return on, along[:count], squares


def _is_wall(along: Float) -> bool:
    """Whether points so many metres along a line are a long stretch, not two people who stand apart."""
    ordered = np.sort(along)
    low, high = quantile(ordered, 0.02), quantile(ordered, 0.98)
    if high - low <= _LENGTH:
        return False
    counts = np.diff(np.searchsorted(ordered, np.arange(low, high + _BIN, _BIN)))
    return bool(np.mean(counts > 0.25 * counts.mean()) > _FILLED)


def _thickness(z: Float) -> Float:
    """(N,) metres off its plane within which a point at each of (N,) depths is a wall's."""
    return np.asarray(_THICK + _THICKER * z * z)


@njit(cache=True, nogil=True, fastmath=True)
def _best_line(points, thickness, weight, pairs):
    """(3,) the line a x + b z + c = 0 through two of the (N, 2) points on which most weight lies."""
    best, found = 0.0, np.zeros(3)
    x, z = points[:, 0].copy(), points[:, 1].copy()
    for trial in range(len(pairs)):
        p, q = points[pairs[trial, 0]], points[pairs[trial, 1]]
        dx, dz = q[0] - p[0], q[1] - p[1]
        length = np.sqrt(dx * dx + dz * dz)
        if length < _APART:
            continue
        a, b = -dz / length, dx / length
        c = -(a * p[0] + b * p[1])
        on = 0.0
        for i in range(len(x)):
            # Without a branch, so that many points are counted at once.
            on += weight[i] if abs(a * x[i] + b * z[i] + c) < thickness[i] else 0.0
        if on > best:
            best = on
            found[0], found[1], found[2] = a, b, c
    return found
