"""Triangulates the polygons of mesh files: convex polygons become fans, and others are triangulated by ear
clipping.
"""

from __future__ import annotations

import manifold3d
import numpy as np

from enliven.arrays import Bool, Float, Int, Int32
from enliven.rotation import unit

_MAX_STRAIGHT_SINE = 1e-9
"""Maximum sine of the turning angle at a corner that counts as straight (three collinear points). It covers
the rounding error of the cross product, which is far below that of float32 coordinates."""


def triangulate(vertices: Float, corners: Int, sizes: Int) -> tuple[Int32, Int]:
    """Triangulates polygons. Each polygon of N corners becomes N - 2 triangles with the same winding.

    Convex polygons become fans from their first corner. Other polygons are projected along their mean normal
    and triangulated by ear clipping, so notches stay empty. Every corner is used, so edges that polygons
    share stay closed.

    Args:
        vertices: (V, 3) positions, in any unit.
        corners: (C,) the vertices of all polygons, one polygon after the other.
        sizes: (P,) the number of corners of each polygon. Polygons with fewer than three corners are left
            out.

    Returns:
        (F, 3) vertices of the triangles, and (F, 3) the index in ``corners`` of each triangle corner.
    """
    sizes = np.asarray(sizes, np.int64)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
    first_triangles = np.concatenate([[0], np.cumsum(np.maximum(sizes - 2, 0))]).astype(np.int64)
    corner_indices: Int = np.empty((int(first_triangles[-1]), 3), np.int64)
    for size in np.unique(sizes[sizes > 2]):
        of = np.flatnonzero(sizes == size)
        fan = np.stack([np.zeros(size - 2, int), np.arange(1, size - 1), np.arange(2, size)], 1)
        corner_indices[first_triangles[of, None] + np.arange(size - 2)] = starts[of, None, None] + fan
        if size > 3:
            points = vertices[np.asarray(corners)[starts[of, None] + np.arange(size)]]
            for polygon_index in np.flatnonzero(~_are_convex(points)):
                polygon = of[polygon_index]
                rows = slice(first_triangles[polygon], first_triangles[polygon + 1])
                corner_indices[rows] = starts[polygon] + _cut_ears(points[polygon_index], fan)
    return np.asarray(corners)[corner_indices].astype(np.int32), corner_indices


def _mean_normals(points: Float) -> Float:
    """Returns (P, 3) unit normals of polygons (P, N, 3) by Newell's method.

    The normal of a polygon without area is zero.
    """
    relative = points - points[:, :1]
    return unit(np.cross(relative, np.roll(relative, -1, 1)).sum(1))


def _are_convex(points: Float) -> Bool:
    """Returns (P,) True for convex polygons (P, N, 3): all corners turn in the same direction, in total by
    one revolution."""
    normals = _mean_normals(points)
    edges = np.roll(points, -1, 1) - points
    following = np.roll(edges, -1, 1)
    turns = np.einsum("pna,pa->pn", np.cross(edges, following), normals)
    lengths = np.linalg.norm(edges, axis=2) * np.linalg.norm(following, axis=2)
    # A star polygon turns left at every corner too, but its angles add up to more than one revolution.
    angles = np.arctan2(turns, (edges * following).sum(2)).sum(1)
    return np.asarray((turns > _MAX_STRAIGHT_SINE * lengths).all(1) & (angles < 3 * np.pi))


def _cut_ears(points: Float, fan: Int) -> Int:
    """Returns (N - 2, 3) triangles of one polygon (N, 3), counter-clockwise seen against its normal.

    Args:
        fan: (N - 2, 3) the triangles to return for a polygon without area.
    """
    normal = _mean_normals(points[None])[0]
    if not normal.any():
        return fan
    right = unit(np.cross(normal, np.eye(3)[np.abs(normal).argmin()]))
    flat = (points - points.mean(0)) @ np.stack([right, np.cross(normal, right)], 1)
    size = np.abs(flat).max()
    ears = np.asarray(manifold3d.triangulate([np.ascontiguousarray(flat / size)]), np.int64).reshape(-1, 3)
    return ears if len(ears) == len(fan) else fan
