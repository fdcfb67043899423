"""The triangle table of marching cubes for all 256 corner configurations of a cell.

The table is computed, not copied. On every face of the cell, a segment separates each run of inside corners
from the rest. Two cells find the same runs on their shared face, so no crack opens between them.

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
"""Maximum number of triangles in a cell."""


def _edge_number(a: int, b: int) -> int:
    """Returns the number of the edge between two corners."""
    axis = (a ^ b).bit_length() - 1
    return 4 * axis + STARTS[axis].index(min(a, b))


@cache
def triangle_table() -> Int32:
    """Returns (256, 16) int32 the edges of each case's triangles, in groups of three, -1 after the last.

    Bit k of the case is set if corner k is inside, that is, its distance is negative. Triangles are
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
    after: dict[int, int] = {}
    for corners in _FACE_CORNERS:
        inside = [bool(case >> corner & 1) for corner in corners]
        for k in range(4):
            if inside[k] or not inside[(k + 1) % 4]:
                continue
            # A run of inside corners begins here. Its segment leads from the end of the run to its beginning.
            last = next(n for n in range(k + 1, k + 5) if not inside[(n + 1) % 4])
            end = _edge_number(corners[last % 4], corners[(last + 1) % 4])
            after[_edge_number(corners[k], corners[(k + 1) % 4])] = end
    loops = []
    while after:
        loop = [next(iter(after))]
        while (following := after.pop(loop[-1])) != loop[0]:
            loop.append(following)
        loops.append(loop)
    return loops


def _loop_triangles(loop: tuple[int, ...]) -> list[tuple[int, int, int]]:
    """Returns the triangles of a loop, with as few inner sides as possible in a face of the cell.

    An inner side in a face would coincide with that of the neighbouring cell, and four triangles would share
    it.
    """
    if len(loop) < 3:
        return []
    best: list[tuple[int, int, int]] = []
    least = np.inf
    for k in range(1, len(loop) - 1):
        triangles = [
            (loop[0], loop[k], loop[-1]),
            *_loop_triangles(loop[: k + 1]),
            *_loop_triangles(loop[k:]),
        ]
        cost = _count_sides_in_faces(triangles, loop)
        if cost < least:
            best, least = triangles, cost
    return best


def _count_sides_in_faces(triangles: list[tuple[int, int, int]], loop: tuple[int, ...]) -> int:
    """Returns the number of inner sides of triangles (not sides of the loop) that lie in a face of the
    cell.
    """
    border = {frozenset(side) for side in pairwise((*loop, loop[0]))}
    inner = {frozenset((t[a], t[(a + 1) % 3])) for t in triangles for a in range(3)} - border
    return sum(1 for side in inner if any(side <= face for face in _edges_of_faces()))


@cache
def _edges_of_faces() -> tuple[frozenset[int], ...]:
    return tuple(
        frozenset(_edge_number(corners[k], corners[(k + 1) % 4]) for k in range(4))
        for corners in _FACE_CORNERS
    )
