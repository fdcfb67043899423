"""Constrained Delaunay triangulation in the plane, refined until the triangles match the edge lengths of the
outline.

manifold3d triangulates by ear clipping. Then inner edges are flipped until all are locally Delaunay, which
gives the constrained Delaunay triangulation (Lawson 1977). Points are added in triangles that are larger than
the edges of the outline around them (P. Liepa, "Filling holes in meshes", 2003, section 4).
"""

from __future__ import annotations

from collections.abc import Sequence

import manifold3d
import numpy as np

from enliven.arrays import Float, Int
from enliven.kernels import copy_row, copy_rows, njit
from enliven.meshes.flips import adjacent_triangles, flip, slot

_MAX_ADDED_POINTS = 20_000
"""Maximum number of points that one refinement adds."""


def triangulate_loops(points: Float, loops: Sequence[Int]) -> Int:
    """Triangulates the area between loops without adding points. Returns (T, 3) counter-clockwise constrained
    Delaunay triangles.

    Args:
        points: (P, 2) positions in the plane.
        loops: the point indices of each loop. Outer loops are counter-clockwise, and holes clockwise.
    """
    order = np.concatenate(loops)
    ears = manifold3d.triangulate([np.ascontiguousarray(points[loop], np.float64) for loop in loops])
    triangles = order[np.asarray(ears, np.int64).reshape(-1, 3)]
    _legalise_all(
        np.ascontiguousarray(points, np.float64), triangles, adjacent_triangles(triangles, len(points))
    )
    return triangles


def refine_triangulation(
    points: Float, triangles: Int, sizes: Float, smooth: int = 3, growth: float = 1.0
) -> tuple[Float, Int]:
    """Refines a triangulation to triangles of about the requested size. The outline stays unchanged.

    Args:
        points: (P, 2) positions in the plane.
        triangles: (T, 3) a constrained Delaunay triangulation of the points.
        sizes: (P,) target edge length around each point.
        smooth: number of smoothing passes. Each pass moves new points to the mean of their neighbours.
        growth: ratio of the target edge length at an added point to the mean of its triangle's corners. Above
            1, triangles grow away from the outline.

    Returns:
        (Q, 2) points, the first P unchanged, and (U, 3) triangles.
    """
    max_points = len(points) + _MAX_ADDED_POINTS
    all_points, all_sizes = np.zeros((max_points, 2)), np.zeros(max_points)
    all_points[: len(points)], all_sizes[: len(points)] = points, sizes
    cells, beside = np.zeros((2 * max_points, 3), np.int64), np.full((2 * max_points, 3), -1, np.int64)
    cells[: len(triangles)] = triangles
    beside[: len(triangles)] = adjacent_triangles(triangles, len(points))
    count, triangle_count = _refine_triangles(
        all_points, all_sizes, cells, beside, len(points), len(triangles), growth
    )
    refined_points, cells, beside = all_points[:count], cells[:triangle_count], beside[:triangle_count]
    for _ in range(smooth):
        _relax_points(refined_points, cells, len(points))
        _legalise_all(refined_points, cells, beside)
    return refined_points.copy(), cells.copy()


@njit(cache=True, nogil=True)
def _twice_signed_area(a, b, c):
    """Returns twice the signed area of the triangle of the points a, b, c (2,). It is positive for
    counter-clockwise points."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@njit(cache=True, nogil=True)
def _in_circle(a, b, c, d):
    """Returns a positive value, scaled to about one, if d lies inside the circle through a, b, c
    (counter-clockwise)."""
    ax, ay, bx, by, cx, cy = a[0] - d[0], a[1] - d[1], b[0] - d[0], b[1] - d[1], c[0] - d[0], c[1] - d[1]
    aa, bb, cc = ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy
    size = max(aa, bb, cc)
    if size == 0.0:
        return 0.0
    return (ax * (by * cc - bb * cy) - ay * (bx * cc - bb * cx) + aa * (bx * cy - by * cx)) / (size * size)


@njit(cache=True, nogil=True)
def _flip_edge_if_better(points, cells, beside, t, k):
    """Flips the edge opposite to corner k of triangle t if the flip is legal and improves the triangulation.
    Returns True if the edge was flipped.
    """
    u = beside[t, k]
    if u < 0:
        return False
    m = slot(beside[u], t)
    a, b, c, d = cells[t, k], cells[t, (k + 1) % 3], cells[t, (k + 2) % 3], cells[u, m]
    if _in_circle(points[a], points[b], points[c], points[d]) <= 1e-10:
        return False
    if (
        _twice_signed_area(points[a], points[b], points[d]) <= 0.0
        or _twice_signed_area(points[a], points[d], points[c]) <= 0.0
    ):
        return False
    flip(cells, beside, t, k)
    return True


@njit(cache=True, nogil=True)
def _legalise_all(points, cells, beside):
    """Flips edges until all inner edges are locally Delaunay. The number of passes is bounded, since rounding
    may undo a flip."""
    for _ in range(200):
        flipped = 0
        for t in range(cells.shape[0]):
            for k in range(3):
                if _flip_edge_if_better(points, cells, beside, t, k):
                    flipped += 1
        if flipped == 0:
            return


@njit(cache=True, nogil=True)
def _refine_triangles(points, sizes, cells, beside, count, some, growth):
    """Adds the centre of each oversized triangle and flips edges, repeatedly. Returns the numbers of points
    and triangles.

    The arrays must have free rows for more points and triangles, and are changed in place. ``count`` and
    ``some`` are the numbers of points and triangles at the start.
    """
    for _ in range(60):
        before, first = count, some
        for t in range(first):
            if count == points.shape[0] or some + 2 > cells.shape[0]:
                break
            a, b, c = cells[t, 0], cells[t, 1], cells[t, 2]
            x = (points[a, 0] + points[b, 0] + points[c, 0]) / 3.0
            y = (points[a, 1] + points[b, 1] + points[c, 1]) / 3.0
            size = (sizes[a] + sizes[b] + sizes[c]) / 3.0
            fits = True
            for v in (a, b, c):
                far = np.sqrt(2.0 * ((points[v, 0] - x) ** 2 + (points[v, 1] - y) ** 2))
                if far <= size or far <= sizes[v]:
                    fits = False
            if not fits:
                continue
            points[count, 0], points[count, 1], sizes[count] = x, y, growth * size
            _split_cell(cells, beside, t, count, some)
            count, some = count + 1, some + 2
        if count == before:
            break
        _legalise_all(points, cells[:some], beside[:some])
    return count, some


@njit(cache=True, nogil=True)
def _split_cell(cells, beside, t, p, some):
    """Splits triangle t in three around point p. The new triangles get the numbers ``some`` and ``some +
    1``."""
    a, b, c = cells[t, 0], cells[t, 1], cells[t, 2]
    over_a, over_b, over_c = beside[t, 0], beside[t, 1], beside[t, 2]
    u, v = some, some + 1
    cells[t, 0], cells[t, 1], cells[t, 2] = p, b, c
    cells[u, 0], cells[u, 1], cells[u, 2] = p, c, a
    cells[v, 0], cells[v, 1], cells[v, 2] = p, a, b
    beside[t, 0], beside[t, 1], beside[t, 2] = over_a, u, v
    beside[u, 0], beside[u, 1], beside[u, 2] = over_b, v, t
    beside[v, 0], beside[v, 1], beside[v, 2] = over_c, t, u
    if over_b >= 0:
        beside[over_b, slot(beside[over_b], t)] = u
    if over_c >= 0:
        beside[over_c, slot(beside[over_c], t)] = v


@njit(cache=True, nogil=True)
def _relax_points(points, cells, fixed):
    """Moves each point with index ``fixed`` or higher to the mean of its neighbours, unless a triangle would
    flip.
    """
    # Compute the target of each new point: the mean of its neighbours.
    total, counts = np.zeros(points.shape), np.zeros(points.shape[0])
    for t in range(cells.shape[0]):
        for k in range(3):
            i, j = cells[t, k], cells[t, (k + 1) % 3]
            for a in range(2):
                total[i, a] += points[j, a]
            counts[i] += 1.0
    wanted = points.copy()
    for i in range(fixed, points.shape[0]):
        if counts[i] > 0.0:
            for a in range(2):
                wanted[i, a] = total[i, a] / counts[i]
    # If a triangle would flip or collapse, move its corners back to their old positions. Then check again.
    for _ in range(10):
        wrong = False
        for t in range(cells.shape[0]):
            a, b, c = cells[t, 0], cells[t, 1], cells[t, 2]
            old_turn = _twice_signed_area(points[a], points[b], points[c])
            if _twice_signed_area(wanted[a], wanted[b], wanted[c]) <= 0.05 * old_turn:
                wrong = True
                for i in (a, b, c):
                    copy_row(wanted[i], points[i])
        if not wrong:
            break
    # Give up if a triangle is still flipped.
    for t in range(cells.shape[0]):
        a, b, c = cells[t, 0], cells[t, 1], cells[t, 2]
        if _twice_signed_area(wanted[a], wanted[b], wanted[c]) <= 0.0:
            return
    copy_rows(points, wanted)
