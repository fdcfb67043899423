"""Walls in a group of pixels: what somebody stands before while the room is not known yet."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.kernels import njit
from enliven_edge.tracking.frame import View

_TRIALS, _SAMPLES = 150, 1500
_LARGEST_WALLS = 4
_AREA, _LENGTH, _FILLED, _BIN = 0.9, 0.9, 0.8, 0.15
"""Square metres and metres across of what is seen of the smallest upright plane that nobody can be."""
_APART = 0.3
"""Metres between two points that a wall is guessed from."""


def without_walls(view: View, mask: Bool, seed: int = 0) -> Bool:
    """The (h, w) mask without what lies in large upright planes; itself where there are none."""
    rest = mask.copy()
    pixel = 1.0 / (view.camera.intrinsics.fx * view.camera.intrinsics.fy)
    random = np.random.default_rng(seed)
    for _ in range(_LARGEST_WALLS):
        flat, z = view.points[rest][:, [0, 2]], view.z[rest]
        if z.dot(z) * pixel < _AREA:
            break
        step = max(1, len(z) // _SAMPLES)
        some, deep = np.ascontiguousarray(flat[::step]), np.ascontiguousarray(z[::step])
        pairs = random.integers(0, len(some), (_TRIALS, 2))
        line = _best_line(some, _thickness(deep), deep * deep * pixel * step, pairs)
        on = np.abs(flat @ line[:2] + line[2]) < _thickness(z)
        if not line.any() or (z[on] ** 2).sum() * pixel < _AREA:
            break
        if not _is_wall(flat[on] @ np.array([-line[1], line[0]])):
            break
        rows, columns = np.nonzero(rest)
        rest[rows[on], columns[on]] = False
    return rest


def _is_wall(along: Float) -> bool:
    """Whether points so many metres along a line are a long stretch, not two people who stand apart."""
    low, high = np.percentile(along, [2, 98])
    counts, _ = np.histogram(along, np.arange(low, high + _BIN, _BIN))
    return bool(high - low > _LENGTH and np.mean(counts > 0.25 * counts.mean()) > _FILLED)


def _thickness(z: Float) -> Float:
    """Metres off its plane within which a point at this depth is a wall's."""
    return np.asarray(0.03 + 0.006 * z * z)


@njit(cache=True, nogil=True, fastmath=True)
def _best_line(points, thickness, weight, pairs):  # type: ignore[no-untyped-def]
    """(3,) the line a x + b z + c = 0 through two of the (N, 2) points on which most weight lies."""
    best, found = 0.0, np.zeros(3)
    for trial in range(len(pairs)):
        p, q = points[pairs[trial, 0]], points[pairs[trial, 1]]
        dx, dz = q[0] - p[0], q[1] - p[1]
        length = np.sqrt(dx * dx + dz * dz)
        if length < _APART:
            continue
        a, b = -dz / length, dx / length
        c = -(a * p[0] + b * p[1])
        on = 0.0
        for i in range(len(points)):
            # Without a branch, so that many points are counted at once.
            on += weight[i] if abs(a * points[i, 0] + b * points[i, 1] + c) < thickness[i] else 0.0
        if on > best:
            best = on
            found[0], found[1], found[2] = a, b, c
    return found
