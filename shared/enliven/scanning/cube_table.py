"""The triangle table of marching cubes for all 256 corner configurations of a cell.

The table is computed, not copied from a publication. On every face of the cell, one line segment separates
each run of adjacent inside corners from the outside corners. Two neighbouring cells have the same runs on
their shared face, so no crack opens between them.

Corner k of a cell is at (k & 1, k >> 1 & 1, k >> 2). Edge 4 a + n runs along axis a; n numbers the four
corners at which an edge along that axis begins.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

from enliven.arrays import Int32

_FACE_CORNERS = ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))
"""Corners of each face, counter-clockwise seen from outside of the cell."""
STARTS = ((0, 2, 4, 6), (0, 1, 4, 5), (0, 1, 2, 3))
"""For each axis, the corners at which the four edges along it begin."""
MOST_TRIANGLES = 5
"""Maximum number of triangles of the surface in a single cell."""


def _edge_number(a: int, b: int) -> int:
    """Returns the number of the edge between two corners."""
    axis = (a ^ b).bit_length() - 1
    return 4 * axis + STARTS[axis].index(min(a, b))


@cache
def triangle_table() -> Int32:
    """Returns the (256, 16) int32 table: for each case, the edges that contain the triangles' corners, three
    per triangle, then -1.

    A case is a bit mask: bit k is set if corner k is inside (its signed distance is negative). Triangles are
    counter-clockwise seen from outside of the surface.
    """
    table = np.full((256, 3 * MOST_TRIANGLES + 1), -1, np.int32)
    for case in range(256):
        edges = [
            edge
            for loop in _surface_loops(case)
            for triangle in _loop_triangles(tuple(loop))
            for edge in triangle
        ]
        table[case, : len(edges)] = edges
    return table


def _surface_loops(case: int) -> list[list[int]]:
    """Returns the closed loops of edges along which the surface intersects the cell's faces."""
    next_edges: dict[int, int] = {}
    for corners in _FACE_CORNERS:
        is_inside = [bool(case >> corner & 1) for corner in corners]
        for k in range(4):
            if is_inside[k] or not is_inside[(k + 1) % 4]:
                continue
            # A run of inside corners begins at this corner. The segment leads from the end of the run to its
            # beginning.
            run_end = next(n for n in range(k + 1, k + 5) if not is_inside[(n + 1) % 4])
            end_edge = _edge_number(corners[run_end % 4], corners[(run_end + 1) % 4])
            next_edges[_edge_number(corners[k], corners[(k + 1) % 4])] = end_edge
    loops = []
    while next_edges:
        loop = [next(iter(next_edges))]
        while (following := next_edges.pop(loop[-1])) != loop[0]:
            loop.append(following)
        loops.append(loop)
    return loops


def _loop_triangles(loop: tuple[int, ...]) -> list[tuple[int, int, int]]:
    """Returns triangles for a loop of edges, with as few diagonals as possible in the faces of the cell.

    A diagonal in a face would coincide with a diagonal of the neighbouring cell, and four triangles would
    then share one edge.
    """
    if len(loop) < 3:
        return []
    best_triangles: list[tuple[int, int, int]] = []
    lowest_cost = np.inf
    for k in range(1, len(loop) - 1):
        triangles = [
            (loop[0], loop[k], loop[-1]),
            *_loop_triangles(loop[: k + 1]),
            *_loop_triangles(loop[k:]),
        ]
        cost = _count_sides_in_faces(triangles, loop)
        if cost < lowest_cost:
            best_triangles, lowest_cost = triangles, cost
    return best_triangles


def _count_sides_in_faces(triangles: list[tuple[int, int, int]], loop: tuple[int, ...]) -> int:
    """Counts the diagonals (triangle sides that are not sides of the loop) that lie in a face of the cell."""
    border = {frozenset(side) for side in pairwise((*loop, loop[0]))}
    diagonals = {frozenset((t[a], t[(a + 1) % 3])) for t in triangles for a in range(3)} - border
    return sum(1 for side in diagonals if any(side <= face for face in _edges_of_faces()))


@cache
def _edges_of_faces() -> tuple[frozenset[int], ...]:
    return tuple(
        frozenset(_edge_number(corners[k], corners[(k + 1) % 4]) for k in range(4))
        for corners in _FACE_CORNERS
    )
