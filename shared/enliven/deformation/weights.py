"""Blending weights: which nodes a point follows, and how much (KinÊtre, below eq. 2)."""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven.arrays import Bool, Float, Int
from enliven.character import SkinWeights

_CANDIDATES = 32


def blending_weights(vertices: Float, owner: Int, positions: Float, near: Bool, k: int = 4) -> SkinWeights:
    """Four nodes and weights a vertex: linear fall-off 1 - d / d_max, d_max to the next node, sum one.

    The distance d is Euclidean, among the nodes that lie near the vertex along the surface. The surface
    decides who may be followed at all, so a vertex of one leg never follows another leg, however near that
    stands. Among those, straight distances make both faces of a thin board follow the same nodes: under D
    (eq. 6), infinite between opposite faces, each face would follow nodes of its own and the board would
    change its thickness where it bends. (R. W. Sumner et al., "Embedded deformation for shape
    manipulation", 2007, eq. 4, squares the fall-off; KinÊtre's is linear.)

    Args:
        vertices: (V, 3) metres.
        owner: (V,) the node that is nearest along the surface.
        positions: (N, 3) metres.
        near: (N, N) whether two nodes are near along the surface.
        k: nodes a vertex, at most 4.
    """
    count = len(positions)
    straight = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    straight[~near] = np.inf
    np.fill_diagonal(straight, 0.0)
    most = min(_CANDIDATES, count)
    candidates = np.argpartition(straight, most - 1, axis=1)[:, :most]
    candidates[~np.isfinite(np.take_along_axis(straight, candidates, 1))] = -1
    indices, weights = _blend(vertices, owner, positions, candidates, k)
    return SkinWeights(indices, weights)


@njit(cache=True, nogil=True)
def _blend(vertices, owner, positions, candidates, k):  # type: ignore[no-untyped-def]
    """Kernel: (V, 4) uint16 nodes, nearest first, and (V, 4) float32 weights."""
    indices = np.zeros((vertices.shape[0], 4), np.uint16)
    weights = np.zeros((vertices.shape[0], 4), np.float32)
    near = np.empty(k + 1)
    who = np.empty(k + 1, np.int64)
    for v in range(vertices.shape[0]):
        found = 0
        for m in range(candidates.shape[1]):
            j = candidates[owner[v], m]
            if j < 0:
                continue
            dx = vertices[v, 0] - positions[j, 0]
            dy = vertices[v, 1] - positions[j, 1]
            dz = vertices[v, 2] - positions[j, 2]
            found = insert(near, who, found, np.sqrt(dx * dx + dy * dy + dz * dz), j)
        # With too few nodes there is no next one: the farthest keeps a little weight.
        most = near[k] if found > k else 1.25 * near[found - 1] + 1e-12
        total = 0.0
        for m in range(min(found, k)):
            total += max(0.0, 1.0 - near[m] / most)
        for m in range(min(found, k)):
            indices[v, m] = who[m]
            if total > 0.0:
                weights[v, m] = max(0.0, 1.0 - near[m] / most) / total
            else:
                weights[v, m] = 1.0 / min(found, k)
    return indices, weights


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
