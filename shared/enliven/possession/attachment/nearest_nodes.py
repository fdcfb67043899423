"""Searches for the nodes within reach of each bone's samples. This is the inner loop of attaching."""

from __future__ import annotations

import numpy as np

from enliven.deformation.graph.surface_kernels import insert_sorted
from enliven.kernels import njit

_INNER_FRACTION = 0.35
"""Fraction of the reach that is searched first."""


@njit(cache=True, nogil=True)
def nearest_facing(points, normals, starts, nodes, node_normals, reach, cosine):
    """Returns the four nearest nodes of each sample that face in the same direction as the sample, nearest
    first.

    Samples come in groups (one group per bone). A node that is out of reach of a whole group is tested only
    once. Nodes in the outer part of the reach are tested only for samples with too few nodes in the inner
    part.

    Args:
        points: (L, 3) metres.
        normals: (L, 3) unit vectors. Zero for a sample without a direction, which accepts every node.
        starts: (G + 1,) int64 the index at which each group begins. The last entry is L.
        nodes: (N, 3) metres.
        node_normals: (N, 3) unit vectors.
        reach: metres.
        cosine: cosine of the maximum angle between the normals of a sample and a node.

    Returns:
        (L, 4) int32 nodes, and (L, 4) their distances, metres. If there are fewer than four nodes, the
        remaining distances are infinite.
    """
    count = points.shape[0]
    indices = np.zeros((count, 4), np.int32)
    lengths = np.full((count, 4), np.inf)
    close = np.empty(nodes.shape[0], np.int64)
    near, who = np.empty(4), np.empty(4, np.int64)
    centre = np.empty(3)
    for g in range(starts.shape[0] - 1):
        first, last = starts[g], starts[g + 1]
        # Collect the candidate nodes for the whole group.
        inner, total = _close_to_group(points, first, last, nodes, reach, centre, close)
        for i in range(first, last):
            node_count, most = 0, reach
            n = normals[i]
            free = n[0] == 0.0 and n[1] == 0.0 and n[2] == 0.0
            # Skip the nodes in the outer part of the group's reach if four nodes in the inner part are near
            # enough.
            for c in range(total):
                if c == inner and most <= _INNER_FRACTION * reach:
                    break
                j = close[c]
                dx, dy, dz = (
                    points[i, 0] - nodes[j, 0],
                    points[i, 1] - nodes[j, 1],
                    points[i, 2] - nodes[j, 2],
                )
                square = dx * dx + dy * dy + dz * dz
                if not square < most * most:
                    continue
                facing = n[0] * node_normals[j, 0] + n[1] * node_normals[j, 1] + n[2] * node_normals[j, 2]
                if free or facing > cosine:
                    node_count = insert_sorted(near, who, node_count, np.sqrt(square), j)
                    if node_count == 4:
                        most = near[3]
            for m in range(node_count):
                indices[i, m], lengths[i, m] = who[m], near[m]
    return indices, lengths


@njit(cache=True, nogil=True)
def _close_to_group(points, first, last, nodes, reach, centre, close):
    """Collects the nodes within ``reach`` of the bounding ball of a group into ``close``.

    Nodes within the inner part of the reach come first.

    Returns:
        The number of nodes in the inner part, and the total number.
    """
    for a in range(3):
        low, high = np.inf, -np.inf
        for i in range(first, last):
            low, high = min(low, points[i, a]), max(high, points[i, a])
        centre[a] = 0.5 * (low + high)
    ball = 0.0
    for i in range(first, last):
        square = 0.0
        for a in range(3):
            square += (points[i, a] - centre[a]) ** 2
        ball = max(ball, square)
    ball = np.sqrt(ball)
    limit, inside = (ball + reach) ** 2, (ball + _INNER_FRACTION * reach) ** 2
    inner = total = 0
    for j in range(nodes.shape[0]):
        dx, dy, dz = nodes[j, 0] - centre[0], nodes[j, 1] - centre[1], nodes[j, 2] - centre[2]
        square = dx * dx + dy * dy + dz * dz
        if square < limit:
            close[total] = j
            if square < inside:
                close[inner], close[total] = j, close[inner]
                inner += 1
            total += 1
    return inner, total


@njit(cache=True, nogil=True)
def to_rest_space(points, indices, weights, pivots, linear, positions):
    """Transforms points (L, 3) of the deformed mesh to the rest space (L, 3), by blending the inverse maps of
    the nodes.

    A node with a singular map counts as not rotated, so that the point stays finite.
    """
    out = np.zeros((points.shape[0], 3))
    inverse = np.empty((3, 3))
    for i in range(points.shape[0]):
        for k in range(4):
            w = weights[i, k]
            if w == 0.0:
                continue
            j = indices[i, k]
            _inverse_into(linear[j], inverse)
            for a in range(3):
                moved = pivots[j, a]
                for c in range(3):
                    moved += inverse[a, c] * (points[i, c] - positions[j, c])
                out[i, a] += w * moved
    return out


@njit(cache=True, nogil=True)
def _inverse_into(m, out):
    """Writes the inverse of ``m`` into ``out`` (3, 3), or the identity if ``m`` is nearly singular."""
    for r in range(3):
        r1, r2 = (r + 1) % 3, (r + 2) % 3
        for c in range(3):
            c1, c2 = (c + 1) % 3, (c + 2) % 3
            out[c, r] = m[r1, c1] * m[r2, c2] - m[r1, c2] * m[r2, c1]
    determinant = m[0, 0] * out[0, 0] + m[0, 1] * out[1, 0] + m[0, 2] * out[2, 0]
    if not abs(determinant) > 1e-3:
        for r in range(3):
            for c in range(3):
                out[r, c] = 1.0 if r == c else 0.0
        return
    for r in range(3):
        for c in range(3):
            out[r, c] /= determinant
