"""The edges of a surface and their stiffness: cotangent weights that are never negative.

Sorkine and Alexa 2007, section 2.1: w_ij is half the sum of the cotangents of the two angles opposite the
edge. These weights cause problems on real meshes. Two obtuse angles give a negative weight (the energy then
falls without bound as the cell folds over), and a needle (a thin triangle) gives an unbounded weight. So
angles below one degree count as one degree, and weights below a hundredth are raised to a hundredth. An edge
at an open border has one angle, which is correct there. Non-manifold edges add up all their angles.
"""

from __future__ import annotations

import numpy as np
import scipy
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import minimum_spanning_tree

from enliven.arrays import Float, Int, Int32
from enliven.deformation.graph.connectivity import label_components

_MIN_ANGLE_SINE = np.sin(np.radians(1.0))
"""Sine of the smallest angle that is used for cotangents. Thinner triangles would give unbounded weights."""
MIN_EDGE_WEIGHT = 0.01
"""Minimum weight of an edge; an edge of the equilateral triangle has 0.58."""
VIRTUAL_EDGE_WEIGHT = 0.5
"""Weight of a virtual edge, which joins two shells of the mesh."""
_LINKS_PER_SHELL = 4
"""Number of vertices on each side that link a shell to the next shell. Three links are enough to prevent a
rotation of one shell relative to the other."""
_MAX_EXACTLY_JOINED_SHELLS = 64
"""Maximum number of shells that are joined at their exactly nearest vertices. With more shells, this search
would take too long."""


def surface_edges(vertices: Float, faces: Int32) -> tuple[Int, Float]:
    """Returns the mesh's edges (E, 2), lower vertex first, without duplicates, and (E,) weights of at least
    ``MIN_EDGE_WEIGHT``.
    """
    count = len(vertices)
    edge_ends, half_cotangents = [], []
    for k in range(3):
        tip, left, right = (faces[:, (k + m) % 3].astype(np.int64) for m in range(3))
        u, v = vertices[left] - vertices[tip], vertices[right] - vertices[tip]
        lengths = np.sqrt((u * u).sum(1) * (v * v).sum(1))
        sine = np.maximum(np.linalg.norm(np.cross(u, v), axis=1), _MIN_ANGLE_SINE * lengths)
        cotangent = (u * v).sum(1) / np.where(sine > 0, sine, 1.0)
        edge_ends.append(np.stack([np.minimum(left, right), np.maximum(left, right)], 1))
        half_cotangents.append(np.clip(cotangent, -1 / _MIN_ANGLE_SINE, 1 / _MIN_ANGLE_SINE) / 2)
    pairs, values = np.concatenate(edge_ends), np.concatenate(half_cotangents)
    is_edge = pairs[:, 0] != pairs[:, 1]
    keys, edge_numbers = np.unique(pairs[is_edge, 0] * count + pairs[is_edge, 1], return_inverse=True)
    weights = np.bincount(edge_numbers.ravel(), values[is_edge], len(keys))
    return np.stack([keys // count, keys % count], 1), np.maximum(weights, MIN_EDGE_WEIGHT)


def find_virtual_edges(vertices: Float, edges: Int) -> tuple[Int, Float]:
    """Returns (J, 2) edges that join all shells at their nearest vertices, and (J,) the weights of these
    edges.

    Each joint consists of several edges between the vertices around the nearest pair, so that it fixes the
    shell's rotation as well as its position. If there are more than 64 shells (a triangle soup), shells are
    first joined to near neighbours.
    """
    count = len(vertices)
    edge_groups: list[Int] = []
    label = label_components(count, edges)
    if label.max() >= _MAX_EXACTLY_JOINED_SHELLS:
        edge_groups.append(_find_near_neighbours(vertices, label))
        label = label_components(count, np.concatenate([edges, *edge_groups]))
    while label.max() > 0:
        sizes = np.bincount(label)
        for shell in np.argsort(sizes)[: min(label.max(), _MAX_EXACTLY_JOINED_SHELLS)]:
            inside = np.flatnonzero(label == shell)
            outside = np.flatnonzero(label != shell)
            if len(inside) and len(outside):
                edge_groups.append(_joining_edges(vertices, inside, outside, label))
                label[inside] = label[edge_groups[-1][0, 1]]
        label = label_components(count, np.concatenate([edges, *edge_groups]))
    links = np.concatenate([np.empty((0, 2), np.int64), *edge_groups])
    links = np.unique(np.sort(links, 1), axis=0)
    return links, np.full(len(links), VIRTUAL_EDGE_WEIGHT)


def _joining_edges(vertices: Float, inside: Int, outside: Int, label: Int) -> Int:
    """Returns (L, 2) edges between the shell ``inside`` and the shell nearest to it, the shortest edge
    first."""
    distance, nearest = scipy.spatial.cKDTree(vertices[outside]).query(vertices[inside])
    first = int(np.argmin(distance))
    inner, outer = int(inside[first]), int(outside[nearest[first]])
    outer_shell = np.flatnonzero(label == label[outer])
    middle = (vertices[inner] + vertices[outer]) / 2
    inner_group, outer_group = (
        _find_nearest_vertices(vertices, group, middle) for group in (inside, outer_shell)
    )
    links = [(inner, outer)]
    inner_tree, outer_tree = (
        scipy.spatial.cKDTree(vertices[vertices_of]) for vertices_of in (inner_group, outer_group)
    )
    links += [(int(a), int(outer_group[outer_tree.query(vertices[a])[1]])) for a in inner_group]
    links += [(int(inner_group[inner_tree.query(vertices[b])[1]]), int(b)) for b in outer_group]
    return np.array(links, np.int64)


def _find_nearest_vertices(vertices: Float, group: Int, middle: Float) -> Int:
    """Returns the vertices of ``group`` that are nearest to the point ``middle`` (3,), the number of links of
    a joint."""
    distance = np.linalg.norm(vertices[group] - middle, axis=1)
    return group[np.argsort(distance, kind="stable")[:_LINKS_PER_SHELL]]


def _find_near_neighbours(vertices: Float, label: Int) -> Int:
    """Returns the shortest edges (L, 2) that join shells, among the edges to each vertex's 16 nearest
    vertices.
    """
    count = len(vertices)
    distance, nearest = scipy.spatial.cKDTree(vertices).query(vertices, k=min(16, count))
    rows = np.repeat(np.arange(count), nearest.shape[1])
    columns, lengths = nearest.ravel(), distance.ravel()
    is_between_shells = label[rows] != label[columns]
    rows, columns, lengths = rows[is_between_shells], columns[is_between_shells], lengths[is_between_shells]
    shells = int(label.max()) + 1
    order = np.argsort(lengths, kind="stable")
    a, b = np.minimum(label[rows], label[columns]), np.maximum(label[rows], label[columns])
    # The edges are sorted by length, so the first edge of each pair of shells is the shortest.
    keys, first = np.unique(a[order] * shells + b[order], return_index=True)
    # SciPy ignores edges with a length of exactly 0, so a tiny length is added.
    tree = minimum_spanning_tree(
        coo_matrix((lengths[order][first] + 1e-12, (keys // shells, keys % shells)), (shells, shells)).tocsr()
    ).tocoo()
    joined_pairs = set(
        (np.minimum(tree.row, tree.col).astype(np.int64) * shells + np.maximum(tree.row, tree.col)).tolist()
    )
    # Keep several short edges for each joined pair of shells.
    pair = a[order] * shells + b[order]
    edges, edge_counts = [], dict.fromkeys(joined_pairs, 0)
    for k, key in zip(order.tolist(), pair.tolist(), strict=True):
        if key in edge_counts and edge_counts[key] < 2 * _LINKS_PER_SHELL:
            edge_counts[key] += 1
            edges.append((rows[k], columns[k]))
    return np.array(edges, np.int64).reshape(-1, 2)
