"""Edge flips in a triangulation that keep its adjacency up to date.

``beside[t, k]`` is the triangle that shares the edge opposite to corner k of triangle t, or -1 at a border.
The caller must check that a flip is legal and improves the triangulation.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Int
from enliven.kernels import njit


def adjacent_triangles(triangles: Int, count: int) -> Int:
    """Returns the adjacency array (T, 3): the triangle across the edge opposite to each corner, or -1 at a
    border.
    """
    starts, ends = triangles[:, [1, 2, 0]].ravel(), triangles[:, [2, 0, 1]].ravel()
    key = np.minimum(starts, ends) * count + np.maximum(starts, ends)
    order = np.argsort(key, kind="stable")
    neighbours = np.full(len(key), -1, np.int64)
    pairs = np.flatnonzero(key[order][1:] == key[order][:-1])
    neighbours[order[pairs]], neighbours[order[pairs + 1]] = order[pairs + 1] // 3, order[pairs] // 3
    return neighbours.reshape(-1, 3)


@njit(cache=True, nogil=True)
def slot(row, value):
    """Returns the index of a value in a row of three, or -1 if the row does not contain it (kernel)."""
    for k in range(3):
        if row[k] == value:
            return k
    return -1


@njit(cache=True, nogil=True)
def flip(triangles, neighbours, t, k):
    """Flips the edge opposite to corner k of triangle t, in place (kernel). The edge is replaced by the other
    diagonal of t and its neighbour.

    Args:
        triangles: (T, 3) vertices, counter-clockwise. The edge has a triangle on both sides.
        neighbours: (T, 3) neighbours of each triangle; see the module's docstring.
    """
    u = neighbours[t, k]
    m = slot(neighbours[u], t)
    a, b, c, d = triangles[t, k], triangles[t, (k + 1) % 3], triangles[t, (k + 2) % 3], triangles[u, m]
    over_b, over_c = neighbours[t, (k + 1) % 3], neighbours[t, (k + 2) % 3]
    under_c, under_b = neighbours[u, slot(triangles[u], c)], neighbours[u, slot(triangles[u], b)]
    triangles[t, 0], triangles[t, 1], triangles[t, 2] = a, b, d
    triangles[u, 0], triangles[u, 1], triangles[u, 2] = a, d, c
    neighbours[t, 0], neighbours[t, 1], neighbours[t, 2] = under_c, u, over_c
    neighbours[u, 0], neighbours[u, 1], neighbours[u, 2] = under_b, over_b, t
    if under_c >= 0:
        neighbours[under_c, slot(neighbours[under_c], u)] = t
    if over_b >= 0:
        neighbours[over_b, slot(neighbours[over_b], t)] = u
