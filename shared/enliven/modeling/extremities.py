"""The ends of a mesh's limbs, where control points are suggested."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from enliven.arrays import Int
from enliven.deformation.surface import Net, net_of
from enliven.mesh import Mesh

_NODES = 200
"""The net has some forty points for each."""


def extremities(mesh: Mesh, most: int = 12) -> Int:
    """(K,) vertices at the ends of limbs, K at most ``most``, the most extreme first."""
    net = net_of(mesh, float(np.sqrt(mesh.area / _NODES)))
    ways = _ways(net)
    middle = int(np.argmin(np.linalg.norm(net.points - net.points.mean(0), axis=1)))
    near = dijkstra(ways, indices=middle)
    chosen: list[int] = []
    while len(chosen) < most:
        chosen.append(int(near.argmax()))
        near = np.minimum(near, dijkstra(ways, indices=chosen[-1]))
    return _vertices_of(net, mesh, chosen)


def _ways(net: Net) -> csr_matrix:
    """(C, C) the net's edges, its shells joined where they are nearest."""
    count = len(net.points)
    rows, columns, lengths = net.web.edges[:, 0], net.web.edges[:, 1], net.web.lengths
    while True:
        graph = csr_matrix((lengths, (rows, columns)), (count, count))
        graph = graph + graph.T
        shells, label = connected_components(graph, directed=False)
        if shells == 1:
            return graph
        inside = label == label[np.bincount(label)[label].argmin()]
        distance, other = cKDTree(net.points[~inside]).query(net.points[inside])
        first = int(distance.argmin())
        rows = np.append(rows, np.flatnonzero(inside)[first])
        columns = np.append(columns, np.flatnonzero(~inside)[other[first]])
        lengths = np.append(lengths, max(float(distance[first]), 1e-12))


def _vertices_of(net: Net, mesh: Mesh, points: list[int]) -> Int:
    """(K,) for each point of the net the nearest vertex of the mesh that a face uses."""
    used = np.unique(mesh.faces)
    return np.asarray(used[cKDTree(mesh.vertices[used]).query(net.points[points])[1]], np.int64)
