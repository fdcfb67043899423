"""Computes triangles from a signed distance function: naive surface nets on a regular grid.

Each cell that the surface crosses gets one vertex, at the mean of the crossings of the cell's edges (S. F. F.
Gibson, "Constrained elastic surface nets", 1998, without the relaxation). Each crossed edge gets one quad.
The result is closed and has well shaped faces. Finally, every vertex is moved onto the surface.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from enliven.arrays import Bool, Float, Int, Int32

Field = Callable[[Float], Float]
"""A function from (N, 3) points to (N,) signed distances in metres, negative inside."""

_CORNERS = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
_SURFACE_TOLERANCE = 1e-9
"""Distance from the surface, as a fraction of a cell, below which a vertex is not moved.

A move would need six more evaluations of the function."""
_EDGES = np.array([[a, b] for a in range(8) for b in range(a + 1, 8) if bin(a ^ b).count("1") == 1])


def surface_of(field: Field, low: Float, high: Float, cell: float) -> tuple[Float, Int32]:
    """Returns (V, 3) vertices and (F, 3) outward faces of the zero set of ``field``.

    Only the box from ``low`` to ``high`` is examined.

    Args:
        field: the signed distance. Parts thinner than a cell are lost.
        low: (3,) a corner of the box in metres, outside the surface.
        high: (3,) the opposite corner, also outside the surface.
        cell: side of a grid cell in metres, which is also the approximate length of an edge.
    """
    axes = [np.arange(low[a], high[a] + cell, cell) for a in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    shape = grid.shape[:3]
    values = field(grid.reshape(-1, 3)).reshape(shape)
    inside = values < 0
    cells = np.argwhere(_find_crossed_cells(inside))
    number = np.full(tuple(s - 1 for s in shape), -1, np.int64)
    number[tuple(cells.T)] = np.arange(len(cells))
    vertices = low + cell * _compute_cell_points(values, cells)
    for _ in range(3):
        vertices = _project_to_surface(field, vertices, cell)
    quads = np.concatenate([_make_quads(inside, number, axis) for axis in range(3)])
    return vertices, _make_triangles(vertices, quads)


def _find_crossed_cells(inside: Bool) -> Bool:
    """Returns True for each cell with corners on both sides of the surface."""
    views = [
        inside[i : inside.shape[0] - 1 + i, j : inside.shape[1] - 1 + j, k : inside.shape[2] - 1 + k]
        for i, j, k in _CORNERS
    ]
    stacked = np.stack(views)
    return np.asarray(stacked.any(0) & ~stacked.all(0))


def _compute_cell_points(values: Float, cells: Int) -> Float:
    """Returns (C, 3) in grid units the mean crossing of each cell.

    It is the mean of the points at which the surface crosses the twelve edges of the cell.
    """
    corners = cells[:, None] + _CORNERS
    at_corner = values[tuple(np.moveaxis(corners, -1, 0))]
    a, b = at_corner[:, _EDGES[:, 0]], at_corner[:, _EDGES[:, 1]]
    crosses = (a < 0) != (b < 0)
    t = np.where(crosses, a / np.where(crosses, a - b, 1.0), 0.0)
    start, end = _CORNERS[_EDGES[:, 0]], _CORNERS[_EDGES[:, 1]]
    points = start + t[..., None] * (end - start)
    mean = (points * crosses[..., None]).sum(1) / crosses.sum(1)[:, None]
    return np.asarray(cells + mean)


def _project_to_surface(field: Field, points: Float, cell: float) -> Float:
    """Moves points onto the surface by one Newton step along the gradient, at most half a cell long.

    Points that are already on the surface are not moved.
    """
    values = field(points)
    off = np.abs(values) > _SURFACE_TOLERANCE * cell
    moved = points.copy()
    moved[off] = _do_newton_step(field, points[off], values[off], cell)
    return moved


def _do_newton_step(field: Field, points: Float, values: Float, cell: float) -> Float:
    """Returns (N, 3) points with these ``values``, moved by one Newton step."""
    h = 1e-4 * cell
    offsets = h * np.concatenate([np.eye(3), -np.eye(3)])
    around = field((points[:, None] + offsets).reshape(-1, 3)).reshape(-1, 6)
    gradient = (around[:, :3] - around[:, 3:]) / (2 * h)
    step = values[:, None] * gradient / np.maximum((gradient**2).sum(1, keepdims=True), 1e-6)
    length = np.linalg.norm(step, axis=1, keepdims=True)
    return np.asarray(points - step * np.minimum(1.0, 0.5 * cell / np.maximum(length, 1e-12)))


def _make_quads(inside: Bool, number: Int, axis: int) -> Int:
    """Returns (Q, 4) the vertices around each grid edge along ``axis`` that the surface crosses.

    The quads face outward.
    """
    first = np.take(inside, range(inside.shape[axis] - 1), axis)
    second = np.take(inside, range(1, inside.shape[axis]), axis)
    at = np.argwhere(first != second)
    b, c = (axis + 1) % 3, (axis + 2) % 3
    # The box lies outside of the surface, so no crossed edge lies on its sides.
    ring = []
    for back_b, back_c in ((1, 1), (0, 1), (0, 0), (1, 0)):
        cell = at.copy()
        cell[:, b] -= back_b
        cell[:, c] -= back_c
        ring.append(number[tuple(cell.T)])
    quads = np.stack(ring, 1)
    leaves = first[tuple(at.T)]
    quads[~leaves] = quads[~leaves][:, ::-1]
    return quads


def _make_triangles(vertices: Float, quads: Int) -> Int32:
    """Returns (F, 3) triangles: each quad is split along its shorter diagonal."""
    corners = vertices[quads]
    first = np.linalg.norm(corners[:, 0] - corners[:, 2], axis=1)
    second = np.linalg.norm(corners[:, 1] - corners[:, 3], axis=1)
    turned = np.where((second < first)[:, None], quads[:, [1, 2, 3, 0]], quads)
    return np.concatenate([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]]).astype(np.int32)
