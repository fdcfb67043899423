"""Which nodes of a possessed mesh go along with a node that is dragged, and how far."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from enliven.arrays import Float, Int, Int32
from enliven.document import GraphShape

_REACH = 0.3
"""Share of the mesh's size, along its graph, within which nodes go along: a limb, and not the whole."""
_AROUND = 1.5
"""Lengths of the middle one of a node's edges that the reach has at least, so that neighbours go along."""
_EVEN = 1e-3
"""Share of an edge's squared length by which slopes across a graph's surface are held at 0; and how much
less than the node of the keys any other goes along."""


def followers(shape: GraphShape, node: int) -> tuple[Int, Float]:
    """The (K,) nodes that go along with a node, and (K, 4) how far, with the slope of that, for a metre.

    The share falls from 1 at the node to 0 at the reach, with slopes of 0 at both: (1 - (a / reach)^2)^2,
    with a the metres along the graph's edges at rest. Slopes are least-squares fits over each node's edges.
    """
    rest, edges = shape.positions, shape.edges
    ways = rest[edges[:, 1]] - rest[edges[:, 0]]
    lengths = np.maximum(np.linalg.norm(ways, axis=1), 1e-9)
    graph = coo_matrix((lengths, (edges[:, 0], edges[:, 1])), shape=(len(rest), len(rest)))
    away = dijkstra(graph, directed=False, indices=node)
    near = lengths[(edges == node).any(1)]
    size = float(np.linalg.norm(np.ptp(shape.mesh.vertices, axis=0)))
    reach = max(_REACH * size, _AROUND * float(np.median(near)) if len(near) else 0.0)
    shares = np.where(away < reach, (1.0 - np.minimum(away / reach, 1.0) ** 2) ** 2, 0.0)
    shares = np.minimum(shares, 1.0 - _EVEN)
    shares[node] = 1.0  # and of no other node, wherever it is
    own = np.flatnonzero(shares > 0.0)
    return own, np.concatenate([shares[own, None], _slopes(rest, edges, shares, node)[own]], 1)


def _slopes(rest: Float, edges: Int32, shares: Float, node: int) -> Float:
    """(N, 3) the slope of the shares (N,) at each node, for a metre; 0 at the node of the keys."""
    ends = np.concatenate([edges, edges[:, ::-1]])
    ways = rest[ends[:, 1]] - rest[ends[:, 0]]
    steps = shares[ends[:, 1]] - shares[ends[:, 0]]
    square, along = np.zeros((len(rest), 3, 3)), np.zeros((len(rest), 3))
    np.add.at(square, ends[:, 0], ways[:, :, None] * ways[:, None, :])
    np.add.at(along, ends[:, 0], ways * steps[:, None])
    held = _EVEN * np.trace(square, axis1=1, axis2=2) + 1e-12
    slopes = np.linalg.solve(square + held[:, None, None] * np.eye(3), along[..., None])[..., 0]
    slopes[node] = 0.0
    return np.asarray(slopes)
