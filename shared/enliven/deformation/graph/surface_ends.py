"""The ends of a mesh's limbs: heads, hands, feet, tails, wherever a surface stands out.

How far a point of the surface is from all others, along the surface, in the mean (M. Hilaga et al., "Topology
matching", 2001) is largest at the ends of limbs. An end counts by how far one must come back from it to get
to one that is farther out (its persistence): a hand first by its longest finger, then by its other ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from enliven.arrays import Float, Int
from enliven.deformation.graph.geodesic_kernels import spread
from enliven.deformation.graph.surface import SurfaceNet, net_of
from enliven.errors import InputError
from enliven.kernels import njit
from enliven.meshes import Mesh
from enliven.union_find import root_of

_NODES = 200
"""Nodes that the net is made for; it has some forty points for each."""
_SOURCES = 32
"""Points, far from each other, with paths to all others: a vertex at a limb's end is far from most of
them."""
_LEAST = 0.02
"""Part of the longest way along the mesh; ends that stand out less are none."""


@dataclass(frozen=True)
class LimbEnds:
    """The ends of a mesh's limbs on the net that paths along its surface run over.

    Attributes:
        points: (C, 3) metres, the net's points.
        ends: (K,) the points at the ends, those that stand out most first.
        prominence: (K,) metres along the surface by which each stands out; infinite for the first.
        longest: metres, the longest way along the surface.
        ways: (C, C) the net's links, in metres.
    """

    points: Float
    ends: Int
    prominence: Float
    longest: float
    ways: csr_matrix

    def ways_from(self, points: Int) -> Float:
        """(P, C) metres along the surface from some points to all."""
        return np.atleast_2d(dijkstra(self.ways, indices=points))


def limb_ends(mesh: Mesh, most: int = 12, nodes: int = _NODES) -> LimbEnds:
    """Returns the ends of limbs of a mesh, at most so many.

    Args:
        nodes: how many the net is made for: parts nearer than half their spacing are taken for one.

    Raises:
        InputError: for a mesh without area.
    """
    if not mesh.area > 0:
        raise InputError("the mesh has no area", where=mesh.name, mend="Give a mesh with faces.")
    net = net_of(mesh, float(np.sqrt(mesh.area / nodes)))
    ways = _ways(net)
    from_sources = _spread_out(ways, _SOURCES)
    far = from_sources.mean(0)
    tips, persistence = _peaks(ways.indptr, ways.indices, far, np.argsort(-far, kind="stable"))
    persistence[np.argmax(persistence)] = np.inf
    order = np.argsort(-persistence, kind="stable")[:most]
    longest = float(from_sources.max())
    order = order[persistence[order] > _LEAST * longest]
    return LimbEnds(net.points, tips[order], persistence[order], longest, ways)


def extremities(mesh: Mesh, most: int = 12) -> Int:
    """(K,) vertices at the ends of limbs, K at most ``most``, those that stand out most first.

    Raises:
        InputError: for a mesh without area.
    """
    from scipy.spatial import cKDTree  # 0.05 s to load, which an edge's start does without

    found = limb_ends(mesh, most)
    used = np.unique(mesh.faces)
    return np.asarray(used[cKDTree(mesh.vertices[used]).query(found.points[found.ends])[1]], np.int64)


def _spread_out(ways: csr_matrix, count: int) -> Float:
    """(S, C) metres along the surface from some points that are far from each other."""
    net = ways.indptr.astype(np.int64), ways.indices, ways.data
    near, _ = spread(*net, np.array([0]))
    rows = list[Float]()
    for _ in range(min(count, ways.shape[0])):
        rows.append(spread(*net, np.array([near.argmax()]))[0])
        near = rows[0] if len(rows) == 1 else np.minimum(near, rows[-1])
    return np.array(rows)


@njit(cache=True, nogil=True)
def _peaks(offsets, neighbours, height, order):  # type: ignore[no-untyped-def]
    """The points that are higher than all around them, and how far each stands over its pass to a higher one.

    The surface comes out of the water from the highest point down; where two islands meet, the lower one's
    peak has found its pass.

    Args:
        order: (C,) the points from the highest down.
    """
    count = height.shape[0]
    parent, peak = np.full(count, -1), np.empty(count, np.int64)
    over = np.zeros(count)
    tips, size = np.empty(count, np.int64), 0
    for v in order:
        parent[v], peak[v] = v, v
        alone = True
        for e in range(offsets[v], offsets[v + 1]):
            u = neighbours[e]
            if parent[u] < 0 or u == v:
                continue
            alone = False
            a, b = root_of(parent, u), root_of(parent, v)
            if a == b:
                continue
            if height[peak[a]] < height[peak[b]]:
                a, b = b, a
            over[peak[b]] = height[peak[b]] - height[v]
            parent[b] = a
        if alone:
            tips[size] = v
            size += 1
    for k in range(size):
        if peak[root_of(parent, tips[k])] == tips[k]:
            over[tips[k]] = height[tips[k]]
    return tips[:size].copy(), over[tips[:size]]


def _ways(net: SurfaceNet) -> csr_matrix:
    """(C, C) the net's edges, its shells joined where they are nearest."""
    count = len(net.points)
    rows, columns, lengths = net.graph.edges[:, 0], net.graph.edges[:, 1], net.graph.lengths
    while True:
        graph = csr_matrix((lengths, (rows, columns)), (count, count))
        graph = graph + graph.T
        shells, label = connected_components(graph, directed=False)
        if shells == 1:
            return graph
        from scipy.spatial import cKDTree

        inside = label == label[np.bincount(label)[label].argmin()]
        distance, other = cKDTree(net.points[~inside]).query(net.points[inside])
        first = int(distance.argmin())
        rows = np.append(rows, np.flatnonzero(inside)[first])
        columns = np.append(columns, np.flatnonzero(~inside)[other[first]])
        lengths = np.append(lengths, max(float(distance[first]), 1e-12))
