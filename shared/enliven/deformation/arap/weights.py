"""The edges of a surface and their stiffness: cotangent weights that are never negative.

Sorkine and Alexa 2007, section 2.1: w_ij is half the sum of the cotangents of the two angles opposite the
edge. Used directly, they cause problems on real meshes. Two obtuse angles give a negative weight (the energy
then falls without bound as the cell folds over), and a needle gives an unbounded weight. Here no angle counts
as smaller than one degree, and no edge as weaker than a hundredth. An open border has one angle per edge,
which is correct for it. Non-manifold edges add up all their angles.
"""

from __future__ import annotations

import numpy as np
import scipy
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import minimum_spanning_tree

from enliven.arrays import Float, Int, Int32
from enliven.deformation.graph import components

_MIN_ANGLE_SINE = np.sin(np.radians(1.0))
"""Sine of the smallest angle that is used for cotangents. Thinner triangles would give unbounded weights."""
MIN_EDGE_WEIGHT = 0.01
"""Minimum weight of an edge; an edge of the equilateral triangle has 0.58."""
VIRTUAL_EDGE_WEIGHT = 0.5
"""The weight of an edge that is not in the mesh."""
_LINKS_PER_SHELL = 4
"""Number of vertices on each side that link a shell to the next. Three links are enough to prevent a rotation
of one shell relative to the next."""
_MAX_EXACTLY_JOINED_SHELLS = 64
"""Maximum number of shells that are joined at their exactly nearest vertices."""


def surface_edges(vertices: Float, faces: Int32) -> tuple[Int, Float]:
    """Returns (E, 2) the mesh's edges, lower vertex first, without duplicates, and (E,) weights of at
    least ``MIN_EDGE_WEIGHT``.
    """
    count = len(vertices)
    ends, halves = [], []
    for k in range(3):
        tip, left, right = (faces[:, (k + m) % 3].astype(np.int64) for m in range(3))
        u, v = vertices[left] - vertices[tip], vertices[right] - vertices[tip]
        lengths = np.sqrt((u * u).sum(1) * (v * v).sum(1))
        sine = np.maximum(np.linalg.norm(np.cross(u, v), axis=1), _MIN_ANGLE_SINE * lengths)
        cotangent = (u * v).sum(1) / np.where(sine > 0, sine, 1.0)
        ends.append(np.stack([np.minimum(left, right), np.maximum(left, right)], 1))
        halves.append(np.clip(cotangent, -1 / _MIN_ANGLE_SINE, 1 / _MIN_ANGLE_SINE) / 2)
    pairs, values = np.concatenate(ends), np.concatenate(halves)
    proper = pairs[:, 0] != pairs[:, 1]
    keys, edge_numbers = np.unique(pairs[proper, 0] * count + pairs[proper, 1], return_inverse=True)
    weights = np.bincount(edge_numbers.ravel(), values[proper], len(keys))
    return np.stack([keys // count, keys % count], 1), np.maximum(weights, MIN_EDGE_WEIGHT)


def virtual_edges(vertices: Float, edges: Int) -> tuple[Int, Float]:
    """Returns (J, 2) edges that join all shells at their nearest places, and (J,) their weights.

    Each joint consists of several edges between the vertices around the nearest pair, so that it fixes the
    shell's rotation as well as its position. Triangle soups (more than 64 shells) are joined to near
    neighbours first.
    """
    count = len(vertices)
    edge_groups: list[Int] = []
    label = components(count, edges)
    if label.max() >= _MAX_EXACTLY_JOINED_SHELLS:
        edge_groups.append(_near_neighbours(vertices, label))
        label = components(count, np.concatenate([edges, *edge_groups]))
    while label.max() > 0:
        sizes = np.bincount(label)
        for shell in np.argsort(sizes)[: min(label.max(), _MAX_EXACTLY_JOINED_SHELLS)]:
            inside = np.flatnonzero(label == shell)
            outside = np.flatnonzero(label != shell)
            if len(inside) and len(outside):
                edge_groups.append(_joining_edges(vertices, inside, outside, label))
                label[inside] = label[edge_groups[-1][0, 1]]
        label = components(count, np.concatenate([edges, *edge_groups]))
    links = np.concatenate([np.empty((0, 2), np.int64), *edge_groups])
    links = np.unique(np.sort(links, 1), axis=0)
    return links, np.full(len(links), VIRTUAL_EDGE_WEIGHT)


def _joining_edges(vertices: Float, inside: Int, outside: Int, label: Int) -> Int:
    """Returns (L, 2) edges between the shell ``inside`` and the one nearest to it; the nearest pair first."""
    distance, nearest = scipy.spatial.cKDTree(vertices[outside]).query(vertices[inside])
    first = int(np.argmin(distance))
    here, there = int(inside[first]), int(outside[nearest[first]])
    other = np.flatnonzero(label == label[there])
    middle = (vertices[here] + vertices[there]) / 2
    ours, theirs = (_nearest_vertices(vertices, group, middle) for group in (inside, other))
    links = [(here, there)]
    of_ours, of_theirs = (scipy.spatial.cKDTree(vertices[each]) for each in (ours, theirs))
    links += [(int(a), int(theirs[of_theirs.query(vertices[a])[1]])) for a in ours]
    links += [(int(ours[of_ours.query(vertices[b])[1]]), int(b)) for b in theirs]
    return np.array(links, np.int64)


def _nearest_vertices(vertices: Float, group: Int, middle: Float) -> Int:
    """Returns the few vertices of ``group`` nearest to ``middle``."""
    distance = np.linalg.norm(vertices[group] - middle, axis=1)
    return group[np.argsort(distance, kind="stable")[:_LINKS_PER_SHELL]]


def _near_neighbours(vertices: Float, label: Int) -> Int:
    """Returns (L, 2) the shortest edges that join shells, among each vertex's sixteen nearest."""
    count = len(vertices)
    distance, nearest = scipy.spatial.cKDTree(vertices).query(vertices, k=min(16, count))
    rows = np.repeat(np.arange(count), nearest.shape[1])
    columns, lengths = nearest.ravel(), distance.ravel()
    between = label[rows] != label[columns]
    rows, columns, lengths = rows[between], columns[between], lengths[between]
    shells = int(label.max()) + 1
    order = np.argsort(lengths, kind="stable")
    a, b = np.minimum(label[rows], label[columns]), np.maximum(label[rows], label[columns])
    # The edges are sorted by length, so the first edge of each pair of shells is the shortest.
    keys, first = np.unique(a[order] * shells + b[order], return_index=True)
    # SciPy ignores edges with a length of exactly 0, so a tiny length is added.
    tree = minimum_spanning_tree(
        coo_matrix((lengths[order][first] + 1e-12, (keys // shells, keys % shells)), (shells, shells)).tocsr()
    ).tocoo()
    chosen = set(
        (np.minimum(tree.row, tree.col).astype(np.int64) * shells + np.maximum(tree.row, tree.col)).tolist()
    )
    # Keep several short edges for each joined pair of shells.
    pair = a[order] * shells + b[order]
    kept, seen = [], dict.fromkeys(chosen, 0)
    for k, key in zip(order.tolist(), pair.tolist(), strict=True):
        if key in seen and seen[key] < 2 * _LINKS_PER_SHELL:
            seen[key] += 1
            kept.append((rows[k], columns[k]))
    return np.array(kept, np.int64).reshape(-1, 2)
