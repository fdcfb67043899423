"""Proportional editing: the nodes of a possessed mesh that follow a dragged node, with a smooth falloff."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from enliven.arrays import Float, Int, Int32
from enliven.document import GraphCharacter

_FALLOFF_FRACTION = 0.3
"""Falloff radius along the graph, as a fraction of the mesh's size. A limb then follows the dragged node, but
not the whole mesh."""
_MIN_FALLOFF_EDGES = 1.5
"""Minimum falloff radius, as a multiple of the median length of the dragged node's edges, so that its
neighbours follow."""
_SLOPE_REGULARIZATION = 1e-3
"""Regularization of the slopes perpendicular to the surface, as a fraction of the squared edge length. It is
also the minimum difference between the share of the dragged node (1) and the share of any other node.
"""


def find_followers(shape: GraphCharacter, node: int) -> tuple[Int, Float]:
    """Returns the nodes that follow a dragged node, and the fraction (share) of its motion that each follows.

    The share falls from 1 at the node to 0 at the falloff radius, with zero slope at both. It is (1 - (a /
    reach)^2)^2, where a is the distance in metres along the graph's edges at rest. Slopes are least-squares
    fits over each node's edges.

    Returns:
        (K,) nodes, and (K, 4) their share followed by its slope per metre.
    """
    rest, edges = shape.positions, shape.edges
    edge_vectors = rest[edges[:, 1]] - rest[edges[:, 0]]
    lengths = np.maximum(np.linalg.norm(edge_vectors, axis=1), 1e-9)
    graph = coo_matrix((lengths, (edges[:, 0], edges[:, 1])), shape=(len(rest), len(rest)))
    away = dijkstra(graph, directed=False, indices=node)
    near = lengths[(edges == node).any(1)]
    size = float(np.linalg.norm(np.ptp(shape.mesh.vertices, axis=0)))
    reach = max(_FALLOFF_FRACTION * size, _MIN_FALLOFF_EDGES * float(np.median(near)) if len(near) else 0.0)
    shares = np.where(away < reach, (1.0 - np.minimum(away / reach, 1.0) ** 2) ** 2, 0.0)
    shares = np.minimum(shares, 1.0 - _SLOPE_REGULARIZATION)
    shares[node] = 1.0  # The dragged node is the only node with the full share.
    following = np.flatnonzero(shares > 0.0)
    return following, np.concatenate(
        [shares[following, None], _weight_gradients(rest, edges, shares, node)[following]], 1
    )


def _weight_gradients(rest: Float, edges: Int32, weights: Float, node: int) -> Float:
    """Returns the gradient (N, 3) of the shares (N,) at each node, per metre. It is 0 at the dragged node."""
    ends = np.concatenate([edges, edges[:, ::-1]])
    edge_vectors = rest[ends[:, 1]] - rest[ends[:, 0]]
    steps = weights[ends[:, 1]] - weights[ends[:, 0]]
    square, along = np.zeros((len(rest), 3, 3)), np.zeros((len(rest), 3))
    np.add.at(square, ends[:, 0], edge_vectors[:, :, None] * edge_vectors[:, None, :])
    np.add.at(along, ends[:, 0], edge_vectors * steps[:, None])
    damping = _SLOPE_REGULARIZATION * np.trace(square, axis1=1, axis2=2) + 1e-12
    slopes = np.linalg.solve(square + damping[:, None, None] * np.eye(3), along[..., None])[..., 0]
    slopes[node] = 0.0
    return np.asarray(slopes)
