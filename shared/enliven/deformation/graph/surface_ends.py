"""The ends of a mesh's limbs: heads, hands, feet, tails, and other protrusions of a surface.

The mean geodesic distance of a point to all other points (M. Hilaga et al., "Topology matching", 2001) is
largest at the ends of limbs. The ends are ranked by persistence: the distance that one must go back from an
end to reach a point that is farther out. A hand is represented first by its longest finger, then by its other
fingers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy

from enliven.arrays import Float, Int
from enliven.deformation.graph.connectivity import label_components
from enliven.deformation.graph.geodesic_kernels import nearest_sources
from enliven.deformation.graph.surface import SurfaceNet, build_net
from enliven.errors import InputError
from enliven.kernels import njit
from enliven.meshes import Mesh, extract_submesh
from enliven.union_find import root_of

_NET_NODE_COUNT = 200
"""Number of graph nodes that determines the resolution of the net. The net has about forty points per
node."""
_PATH_SOURCE_COUNT = 32
"""Number of source points, far from each other, of the paths to all other points. A vertex at the end of a
limb is far from most of the sources."""
_MIN_END_PERSISTENCE = 0.02
"""Minimum persistence of a limb's end, as a fraction of the longest path along the mesh."""

MAX_SMALL_SHELL_POINTS = 64
"""For shells of at most this number of points, the nearest other shell is searched among the neighbours of
their points."""


@dataclass(frozen=True)
class LimbEnds:
    """The ends of a mesh's limbs on the net for paths along its surface.

    Attributes:
        points: (C, 3) metres, the net's points.
        ends: (K,) the points at the ends of limbs, most prominent first.
        prominence: (K,) metres along the surface, the persistence of each end; infinite for the first end.
        longest: length of the longest path along the surface in metres.
        ways: (C, C) sparse, the lengths of the net's links in metres.
    """

    points: Float
    ends: Int
    prominence: Float
    longest: float
    ways: scipy.sparse.csr_matrix

    def distances_from(self, points: Int) -> Float:
        """Returns the distances (P, C) in metres along the surface from ``points`` (P,) to all points."""
        return np.atleast_2d(scipy.sparse.csgraph.dijkstra(self.ways, indices=points))


def find_limb_ends(mesh: Mesh, max_count: int = 12, nodes: int = _NET_NODE_COUNT) -> LimbEnds:
    """Returns the ends of a mesh's limbs, at most ``max_count``.

    Args:
        nodes: number of graph nodes that determines the net's resolution. Parts nearer than half of the
            nodes' spacing are merged.

    Raises:
        InputError: if the mesh has no area.
    """
    if not mesh.area > 0:
        raise InputError(
            "the faces of the mesh have no area", where=mesh.name, remedy="Use a mesh with faces."
        )
    # The submesh excludes vertices without a face.
    surface = extract_submesh(mesh, np.ones(len(mesh.faces), np.bool_))
    net = build_net(surface, float(np.sqrt(mesh.area / nodes)))
    links = _join_net_edges(net)
    from_sources = _sample_far_points(links, _PATH_SOURCE_COUNT)
    far = from_sources.mean(0)
    tips, persistence = find_local_maxima(links.indptr, links.indices, far, np.argsort(-far, kind="stable"))
    persistence[np.argmax(persistence)] = np.inf
    order = np.argsort(-persistence, kind="stable")[:max_count]
    longest = float(from_sources.max())
    order = order[persistence[order] > _MIN_END_PERSISTENCE * longest]
    return LimbEnds(net.points, tips[order], persistence[order], longest, links)


def find_extremity_vertices(mesh: Mesh, max_count: int = 12) -> Int:
    """Returns the vertices (K,) at the ends of limbs, most prominent first, with K at most ``max_count``.

    Raises:
        InputError: if the mesh has no area.
    """
    limbs = find_limb_ends(mesh, max_count)
    used = np.unique(mesh.faces)
    tree = scipy.spatial.cKDTree(mesh.vertices[used])
    return np.asarray(used[tree.query(limbs.points[limbs.ends])[1]], np.int64)


def _sample_far_points(links: scipy.sparse.csr_matrix, count: int) -> Float:
    """Returns the distances (S, C) in metres along the surface from S points that are far from each other."""
    net = links.indptr.astype(np.int64), links.indices, links.data
    near, _ = nearest_sources(*net, np.array([0]))
    rows = list[Float]()
    for _ in range(min(count, links.shape[0])):
        rows.append(nearest_sources(*net, np.array([near.argmax()]))[0])
        near = rows[0] if len(rows) == 1 else np.minimum(near, rows[-1])
    return np.array(rows)


@njit(cache=True, nogil=True)
def find_local_maxima(offsets, neighbours, height, order):
    """Returns the local maxima of ``height``, and the height of each above its pass to a higher maximum.

    This height is the persistence. The points are added from the highest down, and merged into components
    (union-find). When two components merge, the pass of the lower of their two peaks has been found.

    Args:
        order: (C,) the points, sorted from the highest down.
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


def _join_net_edges(net: SurfaceNet) -> scipy.sparse.csr_matrix:
    """Returns the edge lengths of the net in metres as a sparse matrix (C, C). Edges between the nearest
    points of shells are added, so that the net has one component.
    """
    count, edges = len(net.points), net.graph.edges
    graph = scipy.sparse.csr_matrix((net.graph.lengths, (edges[:, 0], edges[:, 1])), (count, count))
    joints = shell_connections(net.points, label_components(count, edges))
    lengths = np.linalg.norm(net.points[joints[:, 0]] - net.points[joints[:, 1]], axis=1)
    gaps = np.maximum(lengths, 1e-12), (joints[:, 0], joints[:, 1])
    graph = graph + scipy.sparse.csr_matrix(gaps, (count, count))
    return scipy.sparse.csr_matrix(graph + graph.T)


def shell_connections(points: Float, label: Int) -> Int:
    """Returns the shortest pairs (S - 1, 2) of points that join S shells into one component.

    Every shell except the largest is linked to its nearest point on another shell, until all are one
    component (Borůvka's algorithm). This needs only a few rounds, for any number of shells.

    Args:
        points: (C, 3) metres, the points of all shells.
        label: (C,) the shell that each point is on, from 0.
    """
    edges, count = np.empty((0, 2), np.int64), int(label.max()) + 1
    while count > 1:
        point, length, other = (
            np.concatenate(column)
            for column in zip(*_find_nearest_other_shell_points(points, label), strict=True)
        )
        order = np.lexsort((length, label[point]))
        nearest = order[np.unique(label[point[order]], return_index=True)[1]]
        pairs = np.sort(np.column_stack([point[nearest], other[nearest]]), axis=1)
        edges = np.unique(np.vstack([edges, pairs]), axis=0)
        merged = label_components(count, label[pairs])
        count, label = int(merged.max()) + 1, merged[label]
    return edges


def _find_nearest_other_shell_points(points: Float, label: Int) -> Iterator[tuple[Int, Float, Int]]:
    """Yields (P,) points of all shells except the largest, their distance in metres to the nearest point of
    another shell, and that point.
    """
    size = np.bincount(label)
    largest = int(size.argmax())
    small = np.flatnonzero((size[label] <= MAX_SMALL_SHELL_POINTS) & (label != largest))
    if len(small):
        # Search for one more neighbour than the largest small shell has points. So at least one neighbour is
        # on another shell.
        near, around = scipy.spatial.cKDTree(points).query(points[small], int(size[label[small]].max()) + 1)
        rows, place = np.arange(len(small)), (label[around] != label[small][:, None]).argmax(1)
        yield small, near[rows, place], around[rows, place]
    for shell in np.flatnonzero(size > MAX_SMALL_SHELL_POINTS):
        if shell != largest:
            inside, outside = np.flatnonzero(label == shell), np.flatnonzero(label != shell)
            near, around = scipy.spatial.cKDTree(points[outside]).query(points[inside])
            yield inside, near, outside[around]
