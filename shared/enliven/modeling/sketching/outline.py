"""Converts a stroke to an outline: closed, evenly spaced, counter-clockwise, without self-intersections."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.kernels import njit
from enliven.modeling.mesh.cut_loops import signed_area

_MAX_OVERSHOOT_FRACTION = 0.15
"""Maximum overshoot of each end of a stroke beyond the closing point, as a fraction of the stroke's
length."""
_ERROR_PLACE = "stroke"


def trace_outline(stroke: Float, count: int, smooth: int = 2) -> Float:
    """Returns (count, 2) points of the closed outline, evenly spaced along it.

    If the two ends of the stroke cross each other, the parts beyond the crossing are removed.

    Args:
        stroke: (N, 2) metres, open or closed.
        count: number of points.
        smooth: number of smoothing passes, which remove the tremor of the hand.

    Raises:
        InputError: if the stroke has too few points, crosses itself, or encloses no area.
    """
    points = np.array(stroke, np.float64).reshape(-1, 2)
    if not np.isfinite(points).all():
        problem = "some positions of the stroke are not finite numbers"
        raise InputError(problem, where=_ERROR_PLACE, remedy="Draw the stroke again.")
    extent = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    points = _drop_repeated_points(points, 1e-6 * extent)
    if len(points) < 3:
        raise InputError(
            "the stroke is only a dot or a line",
            where=_ERROR_PLACE,
            remedy="Draw a closed outline of the part.",
        )
    dense = _resample_polyline(points, 2 * count, closed=False)
    crossings = find_crossing_segments(dense, closed=False)
    if len(crossings):
        dense = _remove_ends(dense, crossings)
    even = _resample_polyline(_drop_repeated_points(dense, 1e-6 * extent), count, closed=True)
    # Smoothing can make a thin tip cross itself. In that case, smooth fewer times.
    points = even
    for times in range(smooth, -1, -1):
        points = _smooth_points(even, times)
        if len(find_crossing_segments(points, closed=True)) == 0:
            break
    else:
        raise InputError(
            "the outline crosses itself",
            where=_ERROR_PLACE,
            remedy="Draw an outline that does not cross itself.",
        )
    size = signed_area(points)
    length = float(np.linalg.norm(np.roll(points, -1, 0) - points, axis=1).sum())
    if abs(size) < 1e-3 * length**2 / (4 * np.pi):
        raise InputError(
            "the stroke encloses no area", where=_ERROR_PLACE, remedy="Draw a closed outline of the part."
        )
    return points if size > 0 else points[::-1].copy()


def _smooth_points(points: Float, times: int) -> Float:
    for _ in range(times):
        points = 0.5 * points + 0.25 * (np.roll(points, 1, 0) + np.roll(points, -1, 0))
    return points


def _drop_repeated_points(points: Float, min_distance: float) -> Float:
    """Returns the points (N, 2) without points that repeat the previous point, and without last points that
    repeat the first point."""
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    points = points[np.concatenate([[True], step > min_distance])] if len(points) else points
    while len(points) > 1 and np.linalg.norm(points[-1] - points[0]) <= min_distance:
        points = points[:-1]
    return points


def _resample_polyline(points: Float, count: int, closed: bool) -> Float:
    """Returns (count, 2) points at equal steps along a polyline."""
    path = np.concatenate([points, points[:1]]) if closed else points
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    arc_lengths = np.linspace(0.0, along[-1], count, endpoint=not closed)
    return np.stack([np.interp(arc_lengths, along, path[:, k]) for k in range(2)], 1)


def find_crossing_segments(points: Float, closed: bool) -> Float:
    """Returns (K, 2) pairs of crossing segments, the earlier segment first. Each value is the number of the
    segment plus the position along it (0 to 1)."""
    ends = np.roll(points, -1, 0) if closed else points[1:]
    starts = points if closed else points[:-1]
    return np.array(
        _crossing_kernel(np.ascontiguousarray(starts), np.ascontiguousarray(ends), closed)
    ).reshape(-1, 2)


@njit(cache=True, nogil=True)
def _crossing_kernel(starts, ends, closed):
    """Finds the pairs for :func:`find_crossing_segments` (kernel).

    Segments that share an end do not cross.
    """
    crossings = [(0.0, 0.0) for _ in range(0)]
    count = starts.shape[0]
    for i in range(count):
        ax, ay = ends[i, 0] - starts[i, 0], ends[i, 1] - starts[i, 1]
        for j in range(i + 2, count):
            if closed and i == 0 and j == count - 1:
                continue
            bx, by = ends[j, 0] - starts[j, 0], ends[j, 1] - starts[j, 1]
            cross = ax * by - ay * bx
            # Skip parallel segments, which do not cross. For collinear segments, rounding would give
            # arbitrary results.
            if abs(cross) <= 1e-9 * np.sqrt((ax * ax + ay * ay) * (bx * bx + by * by)):
                continue
            x, y = starts[j, 0] - starts[i, 0], starts[j, 1] - starts[i, 1]
            s, t = (x * by - y * bx) / cross, (x * ay - y * ax) / cross
            if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
                crossings.append((i + s, j + t))
    return crossings


def _remove_ends(points: Float, crossings: Float) -> Float:
    """Returns the points (N, 2) of the stroke between its two passages through the point where its ends
    cross."""
    count = len(points) - 1
    near_ends = (crossings[:, 0] < _MAX_OVERSHOOT_FRACTION * count) & (
        crossings[:, 1] > (1 - _MAX_OVERSHOOT_FRACTION) * count
    )
    if not near_ends.any():
        crossing_point = points[int(crossings[0, 0])]
        problem = f"the outline crosses itself at ({crossing_point[0]:.3g}, {crossing_point[1]:.3g})"
        raise InputError(problem, where=_ERROR_PLACE, remedy="Draw an outline that does not cross itself.")
    # Cut at the innermost crossing of the two ends, because this removes all of their other crossings too.
    pick = crossings[near_ends]
    start, end = pick[np.argmin(pick[:, 1] - pick[:, 0])]
    first = points[int(start)] + (start - int(start)) * (points[int(start) + 1] - points[int(start)])
    return np.concatenate([first[None], points[int(start) + 1 : int(end) + 1]])
