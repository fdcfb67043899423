"""The ends of a mesh's limbs: heads, hands, feet, tails, wherever a surface stands out.

How far a point of the surface is from all others, along the surface, in the mean (M. Hilaga et al., "Topology
matching", 2001) is largest at the ends of limbs. An end counts by how far one must come back from it to get
to one that is farther out (its persistence): a hand first by its longest finger, then by its other ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from enliven.arrays import Float, Int
from enliven.deformation.graph.geodesic_kernels import spread
from enliven.deformation.graph.surface import SurfaceNet, net_of
from enliven.errors import InputError
from enliven.kernels import njit
from enliven.meshes import Mesh, submesh
from enliven.union_find import root_of

_NODES = 200
"""Nodes that the net is made for; it has some forty points for each."""
_SOURCES = 32
"""Points, far from each other, with paths to all others: a vertex at a limb's end is far from most of
them."""
_LEAST = 0.02
"""Part of the longest way along the mesh; ends that stand out less are none."""

_SMALL = 64
"""Points of a shell up to which it is joined by the neighbours of its points among all points."""


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
    surface = submesh(mesh, np.ones(len(mesh.faces), np.bool_))  # vertices without a face are none of it
    net = net_of(surface, float(np.sqrt(mesh.area / nodes)))
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
    found = limb_ends(mesh, most)
    used = np.unique(mesh.faces)
    tree = scipy.spatial.cKDTree(mesh.vertices[used])
    return np.asarray(used[tree.query(found.points[found.ends])[1]], np.int64)


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
def _peaks(offsets, neighbours, height, order):
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
    count, edges = len(net.points), net.graph.edges
    graph = csr_matrix((net.graph.lengths, (edges[:, 0], edges[:, 1])), (count, count))
    joints = joined_shells(net.points, connected_components(graph, directed=False)[1])
    lengths = np.linalg.norm(net.points[joints[:, 0]] - net.points[joints[:, 1]], axis=1)
    graph = graph + csr_matrix((np.maximum(lengths, 1e-12), (joints[:, 0], joints[:, 1])), (count, count))
    return csr_matrix(graph + graph.T)


def joined_shells(points: Float, label: Int) -> Int:
    """Returns (S - 1, 2) pairs of points that make one piece of S shells, the shortest that do.

    Every shell but the largest takes its nearest point of another one, again and again until all are one
    (Borůvka's algorithm): a few rounds, however many shells there are.

    Args:
        points: (C, 3) metres.
        label: (C,) the shell that each point is on, from 0.
    """
    edges, count = np.empty((0, 2), np.int64), int(label.max()) + 1
    while count > 1:
        point, length, other = (
            np.concatenate(column) for column in zip(*_beside(points, label), strict=True)
        )
        order = np.lexsort((length, label[point]))
        nearest = order[np.unique(label[point[order]], return_index=True)[1]]
        pairs = np.sort(np.column_stack([point[nearest], other[nearest]]), axis=1)
        edges = np.unique(np.vstack([edges, pairs]), axis=0)
        links = csr_matrix((np.ones(len(pairs)), (label[pairs[:, 0]], label[pairs[:, 1]])), (count, count))
        count, merged = connected_components(links, directed=False)
        label = merged[label]
    return edges


def _beside(points: Float, label: Int) -> Iterator[tuple[Int, Float, Int]]:
    """Yields (P,) points of shells but the largest, metres to the nearest point of another, and that one."""
    size = np.bincount(label)
    largest = int(size.argmax())
    small = np.flatnonzero((size[label] <= _SMALL) & (label != largest))
    if len(small):
        # Of so many neighbours of a point one at least is on another shell.
        near, around = scipy.spatial.cKDTree(points).query(points[small], int(size[label[small]].max()) + 1)
        rows, place = np.arange(len(small)), (label[around] != label[small][:, None]).argmax(1)
        yield small, near[rows, place], around[rows, place]
    for shell in np.flatnonzero(size > _SMALL):
        if shell != largest:
            inside, outside = np.flatnonzero(label == shell), np.flatnonzero(label != shell)
            near, around = scipy.spatial.cKDTree(points[outside]).query(points[inside])
            yield inside, near, outside[around]
