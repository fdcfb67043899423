"""Blending weights: which nodes a point follows, and how much (KinÊtre, below eq. 2).

A vertex follows the four nearest nodes with linear fall-off 1 - d / d_max, d_max to the fifth (or two node
spacings, whichever is less, so that the tip of an arm does not follow the other arms), sum one. Where
d is continuous along the surface, so are these weights, whichever nodes enter and leave the four: a node
enters with weight zero. So nothing tears. KinÊtre's d is Euclidean, which lets a vertex of one leg follow
the other leg. Ours is

    d(v, j) = e + 2 max(0, g - 1.5 e - s / 2)

with e the Euclidean distance, g the way along the surface and s the node spacing: e itself, until the way
along the surface is a detour; from there it grows with the detour. Straight distances make both faces of a
thin board follow the same nodes; g leads through thin parts (:mod:`enliven.deformation.surface`).

One thing is left that could crease: nodes that lie close together, as eq. 6 puts them where the surface
bends. Between two such flocks all five distances are nearly equal, and the weights change from one flock to
the other within millimetres. So only *carriers* are followed, nodes that are not too near to each other along
the surface; the others act on them through the graph.

(R. W. Sumner et al., "Embedded deformation for shape manipulation", 2007, eq. 4, squares the fall-off.)
"""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven.arrays import Float, Int, Int32
from enliven.character import SkinWeights
from enliven.deformation.surface import Net, members, points_around

DETOUR, SLACK = 1.5, 0.5
"""A way along the surface is a detour where it is longer than 1.5 times the straight way and half a node
spacing."""
_APART = 0.6
"""How many node spacings two nodes that carry vertices are apart at least."""
_FARTHEST = 2.0
"""How many node spacings away a node has no weight any more, unless it is the nearest or nearly so."""
_BLUR = 1.7
"""Cells of the net: a vertex takes its ways along the surface from the points that are as near as this."""
_AROUND = 48
"""Points at most that a vertex takes its ways from, the nearest to its own first."""
_KEPT = 32
"""Nodes at most that the vertices of one point of the net choose from."""


def carriers(positions: Float, ways: Float, spacing: float, least: int = 5) -> Int:
    """(M,) the nodes that vertices follow, ascending: each that is not near to one before it.

    Where that would leave fewer than ``least``, all nodes.

    Args:
        positions: (N, 3) metres.
        ways: (N, N) metres along the surface.
        spacing: metres between nodes.
    """
    straight = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    near = (straight < _APART * spacing) & (ways < 1.5 * _APART * spacing)
    chosen = np.zeros(len(positions), bool)
    for j in range(len(positions)):
        chosen[j] = not (near[j] & chosen).any()
    return np.flatnonzero(chosen) if chosen.sum() >= least else np.arange(len(positions))


def blending_weights(
    net: Net, near: tuple[Int, Int32, Float], positions: Float, spacing: float, k: int = 4
) -> SkinWeights:
    """Four nodes and weights for each vertex of the net's mesh, the nearest node first.

    Args:
        net: of the mesh.
        near: the nodes near each point of the net, and how far along the surface
            (:func:`enliven.deformation.surface.ways_from_nodes`).
        positions: (N, 3) metres.
        spacing: metres, s.
        k: nodes a vertex, at most 4.
    """
    offsets, nodes, ways = near
    chosen, detours = _candidates(net.points, net.radii, offsets, nodes, ways, positions, spacing, k)
    indices, weights = _blend(
        net.mesh.vertices,
        *members(net.of_vertex, len(net.points)),
        net.points,
        net.radii > 0,
        chosen,
        detours,
        points_around(net, 1.5 * _BLUR * net.cell),
        near,
        positions,
        np.array([spacing, net.cell, ways.max(initial=0.0)]),
        k,
    )
    return SkinWeights(indices, weights)


@njit(cache=True, nogil=True, inline="always")
def _distance(straight, way, spacing):  # type: ignore[no-untyped-def]
    """d of the module's docstring."""
    return straight + 2.0 * max(0.0, way - DETOUR * straight - SLACK * spacing)


@njit(cache=True, nogil=True)
def _candidates(points, radii, offsets, nodes, ways, positions, spacing, k):  # type: ignore[no-untyped-def]
    """(C, 32) the nodes (-1: none) that may be among the k + 1 nearest of a vertex, and (C,) if d needs g.

    Over a metre of the surface d changes by a metre at most, or four on a detour; so who is nearest anywhere
    within a point's radius is known.
    """
    count = points.shape[0]
    chosen = np.full((count, _KEPT), -1, np.int32)
    detours = np.zeros(count, np.bool_)
    best, who = np.empty(_KEPT), np.empty(_KEPT, np.int64)
    for c in range(count):
        found = 0
        for m in range(offsets[c], offsets[c + 1]):
            j = nodes[m]
            x, y, z = (
                points[c, 0] - positions[j, 0],
                points[c, 1] - positions[j, 1],
                points[c, 2] - positions[j, 2],
            )
            found = insert(best, who, found, _distance(np.sqrt(x * x + y * y + z * z), ways[m], spacing), m)
        for i in range(found):
            m = who[i]
            if found > k and best[i] > best[k] + 8.0 * radii[c]:
                break
            j = nodes[m]
            x, y, z = (
                points[c, 0] - positions[j, 0],
                points[c, 1] - positions[j, 1],
                points[c, 2] - positions[j, 2],
            )
            if ways[m] + 2.6 * radii[c] > DETOUR * np.sqrt(x * x + y * y + z * z) + SLACK * spacing:
                detours[c] = True
        slack = 8.0 if detours[c] else 2.0
        for i in range(found):
            if found > k and best[i] > best[k] + slack * radii[c] + 1e-9 * spacing:
                break
            chosen[c, i] = nodes[who[i]]
    return chosen, detours


@njit(cache=True, nogil=True)
def _way_of(near, c, j, missing):  # type: ignore[no-untyped-def]
    """Metres along the surface from the point c to the node j; ``missing`` where it is not near."""
    offsets, nodes, ways = near
    low, high = offsets[c], offsets[c + 1]
    while low < high:
        middle = (low + high) // 2
        if nodes[middle] < j:
            low = middle + 1
        else:
            high = middle
    if low < offsets[c + 1] and nodes[low] == j:
        return ways[low]
    return missing


@njit(cache=True, nogil=True)
def _blend(vertices, starts, order, points, spread, chosen, detours, around, near, positions, sizes, k):  # type: ignore[no-untyped-def]
    """Kernel: (V, 4) uint16 nodes, nearest first, and (V, 4) float32 weights."""
    spacing, cell, reach = sizes[0], sizes[1], sizes[2]
    indices = np.zeros((vertices.shape[0], 4), np.uint16)
    weights = np.zeros((vertices.shape[0], 4), np.float32)
    best, who = np.empty(k + 1), np.empty(k + 1, np.int64)
    ways, mean = np.empty((_AROUND, _KEPT)), np.empty(_KEPT)
    for c in range(points.shape[0]):
        count = 0
        while count < _KEPT and chosen[c, count] >= 0:
            count += 1
        first, last = around[0][c], min(around[0][c + 1], around[0][c] + _AROUND)
        if detours[c]:
            for m in range(count):
                mean[m] = _way_of(near, c, chosen[c, m], reach)
                if spread[c]:
                    for b in range(first, last):
                        ways[b - first, m] = _way_of(near, around[1][b], chosen[c, m], reach)
        for i in range(starts[c], starts[c + 1]):
            v = order[i]
            if detours[c] and spread[c]:
                _average(vertices[v], points, around[1][first:last], ways, mean, count, _BLUR * cell)
            found = 0
            for m in range(count):
                j = chosen[c, m]
                x, y, z = (
                    vertices[v, 0] - positions[j, 0],
                    vertices[v, 1] - positions[j, 1],
                    vertices[v, 2] - positions[j, 2],
                )
                length = np.sqrt(x * x + y * y + z * z)
                if detours[c]:
                    length = _distance(length, mean[m], spacing)
                found = insert(best, who, found, length, j)
            _fall_off(best, who, found, k, _FARTHEST * spacing, indices[v], weights[v])
    return indices, weights


@njit(cache=True, nogil=True)
def _average(vertex, points, around, ways, mean, count, width):  # type: ignore[no-untyped-def]
    """The ways from a vertex: those from the points around it, by a smooth kernel of their distance.

    (A kernel mean reproduces no slope by itself, but the points lie evenly around the vertex.)
    """
    total = 0.0
    mean[:count] = 0.0
    for b in range(around.shape[0]):
        p = around[b]
        x, y, z = vertex[0] - points[p, 0], vertex[1] - points[p, 1], vertex[2] - points[p, 2]
        share = max(0.0, 1.0 - (x * x + y * y + z * z) / (width * width)) ** 2
        if share > 0.0:
            total += share
            for m in range(count):
                mean[m] += share * ways[b, m]
    if total > 0.0:
        for m in range(count):
            mean[m] /= total
    else:
        for m in range(count):
            mean[m] = ways[0, m]


@njit(cache=True, nogil=True, inline="always")
def _fall_off(near, who, found, k, farthest, indices, weights):  # type: ignore[no-untyped-def]
    """The nodes (4,) and weights (4,) of one vertex from its nearest nodes."""
    # With too few nodes there is no next one: the farthest keeps a little weight.
    most = near[k] if found > k else 1.25 * near[found - 1] + 1e-12
    most = min(most, max(farthest, 1.5 * near[0]))
    total = 0.0
    for m in range(min(found, k)):
        total += max(0.0, 1.0 - near[m] / most)
    for m in range(min(found, k)):
        indices[m] = who[m]
        weights[m] = max(0.0, 1.0 - near[m] / most) / total if total > 0.0 else 1.0 / min(found, k)


@njit(cache=True, nogil=True)
def insert(near, who, found, length, item):  # type: ignore[no-untyped-def]
    """Keep ``near`` the smallest lengths, ascending, ``who`` beside it; returns how many there are."""
    if found == near.shape[0]:
        if length >= near[found - 1]:
            return found
        found -= 1
    i = found
    while i > 0 and near[i - 1] > length:
        near[i], who[i] = near[i - 1], who[i - 1]
        i -= 1
    near[i], who[i] = length, item
    return found + 1
