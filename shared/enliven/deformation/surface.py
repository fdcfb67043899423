"""Distances along a surface: which node each vertex belongs to, and how far nodes are from each other.

Two legs may be near in space and far along the surface. Whoever links nodes, or lets vertices follow nodes,
asks here first. Paths run along the edges of the welded mesh, halved until they are short enough.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from enliven.arrays import Float, Int, Int32
from enliven.mesh import Mesh, weld
from enliven.mesh_kernels import shells, split_long_edges

_MOST_VERTICES = 200_000


class Territories(NamedTuple):
    """Who is near whom along the surface.

    Attributes:
        owner: (V,) the node that each vertex of the mesh is nearest to along the surface.
        shell: (N,) the number of the shell that each node lies on.
        borders: (B, 2) pairs of nodes whose territories touch.
        lengths: (B,) metres, the shortest way between the two across their border.
    """

    owner: Int
    shell: Int
    borders: Int
    lengths: Float


def territories(mesh: Mesh, positions: Float, faces: Int32, spacing: float) -> Territories:
    """Split the mesh between nodes by distance along the surface (a geodesic Voronoi diagram).

    A shell without any node goes to the node that is nearest in space.

    Args:
        mesh: any triangles.
        positions: (N, 3) metres, the nodes.
        faces: (N,) the face of ``mesh`` that each node lies on.
        spacing: metres between nodes; edges longer than half of it are halved.
    """
    welded, welded_of = weld(mesh)
    vertices, small, origin = _halved(welded, spacing / 2)
    start, seed_vertex, seed_length = _seeds(vertices, small, origin, positions, faces)
    offsets, neighbours = _adjacency(small, len(vertices))
    lengths, owner = _spread(vertices, offsets, neighbours, start, seed_vertex, seed_length)
    # A seed that another node owns is a border too; it links nodes that own no vertex at all.
    inner = np.stack([start, owner[seed_vertex]], 1)
    outer, across = _crossings(vertices, small, lengths, owner)
    borders, across = _shortest(
        np.concatenate([inner, outer]), np.concatenate([seed_length + lengths[seed_vertex], across])
    )
    shell = shells(small, len(vertices))
    node_shell = shell[small[np.searchsorted(origin, faces), 0]]
    _adopt_orphans(vertices, shell, owner, positions)
    return Territories(owner[welded_of], node_shell, borders, across)


def between_nodes(count: int, edges: Int, lengths: Float, limit: float) -> Float:
    """(N, N) the shortest way between nodes over weighted edges; infinite beyond ``limit`` metres."""
    if len(edges) == 0:
        return np.where(np.eye(count, dtype=bool), 0.0, np.inf)
    # csr_matrix would add up edges given twice, so each is given once.
    pairs, shortest = _shortest(edges.astype(np.int64), lengths)
    graph = csr_matrix((np.maximum(shortest, 1e-12), (pairs[:, 0], pairs[:, 1])), (count, count))
    return np.asarray(dijkstra(graph, directed=False, limit=limit))


def _halved(welded: Mesh, longest: float) -> tuple[Float, Int32, Int]:
    """The vertices and faces of a finer mesh, and each face's number in the mesh given (ascending)."""
    vertices, faces = welded.vertices, welded.faces
    origin = np.arange(len(faces))
    while True:
        finer, split, parents, source = split_long_edges(vertices, faces, longest)
        if len(parents) == 0 or len(finer) > max(_MOST_VERTICES, len(welded.vertices)):
            return vertices, faces, origin
        vertices, faces, origin = finer, split, origin[source]


def _seeds(
    vertices: Float, small: Int32, origin: Int, positions: Float, faces: Int32
) -> tuple[Int, Int, Float]:
    """(K,) node, vertex and length of the straight ways from each node to the corners inside its face."""
    first = np.searchsorted(origin, faces)
    last = np.searchsorted(origin, faces, side="right")
    node = np.repeat(np.arange(len(faces)), (last - first) * 3)
    corner = np.concatenate([small[a:b].reshape(-1) for a, b in zip(first, last, strict=True)])
    return node, corner.astype(np.int64), np.linalg.norm(vertices[corner] - positions[node], axis=1)


@njit(cache=True, nogil=True)
def _adjacency(faces, count):  # type: ignore[no-untyped-def]
    """CSR neighbours of each vertex; an edge of two faces is there twice, which does no harm."""
    offsets = np.zeros(count + 1, np.int64)
    for f in range(faces.shape[0]):
        for c in range(3):
            offsets[faces[f, c] + 1] += 2
    for v in range(count):
        offsets[v + 1] += offsets[v]
    fill = offsets[:-1].copy()
    neighbours = np.empty(offsets[count], np.int32)
    for f in range(faces.shape[0]):
        for c in range(3):
            v = faces[f, c]
            neighbours[fill[v]] = faces[f, (c + 1) % 3]
            neighbours[fill[v] + 1] = faces[f, (c + 2) % 3]
            fill[v] += 2
    return offsets, neighbours


@njit(cache=True, nogil=True)
def _spread(vertices, offsets, neighbours, node, seed_vertex, seed_length):  # type: ignore[no-untyped-def]
    """Dijkstra from all nodes at once: (V,) metres to the nearest node (infinite: none), and which (-1)."""
    count = vertices.shape[0]
    lengths = np.full(count, np.inf)
    owner = np.full(count, -1, np.int64)
    done = np.zeros(count, np.bool_)
    keys = np.empty(neighbours.shape[0] + seed_vertex.shape[0] + 1)
    items = np.empty(keys.shape[0], np.int32)
    size = 0
    for s in range(seed_vertex.shape[0]):
        v = seed_vertex[s]
        if seed_length[s] < lengths[v]:
            lengths[v] = seed_length[s]
            owner[v] = node[s]
            size = _push(keys, items, size, seed_length[s], v)
    while size > 0:
        v = items[0]
        size = _pop(keys, items, size)
        if done[v]:
            continue
        done[v] = True
        for e in range(offsets[v], offsets[v + 1]):
            u = neighbours[e]
            if done[u]:
                continue
            dx = vertices[u, 0] - vertices[v, 0]
            dy = vertices[u, 1] - vertices[v, 1]
            dz = vertices[u, 2] - vertices[v, 2]
            length = lengths[v] + np.sqrt(dx * dx + dy * dy + dz * dz)
            if length < lengths[u]:
                lengths[u] = length
                owner[u] = owner[v]
                size = _push(keys, items, size, length, u)
    return lengths, owner


@njit(cache=True, nogil=True)
def _push(keys, items, size, key, item):  # type: ignore[no-untyped-def]
    """Add to a binary heap in two arrays; returns the new size."""
    i = size
    while i > 0:
        parent = (i - 1) // 2
        if keys[parent] <= key:
            break
        keys[i], items[i] = keys[parent], items[parent]
        i = parent
    keys[i], items[i] = key, item
    return size + 1


@njit(cache=True, nogil=True)
def _pop(keys, items, size):  # type: ignore[no-untyped-def]
    """Take the smallest key off the heap; returns the new size."""
    size -= 1
    key, item = keys[size], items[size]
    i = 0
    while 2 * i + 1 < size:
        child = 2 * i + 1
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if key <= keys[child]:
            break
        keys[i], items[i] = keys[child], items[child]
        i = child
    keys[i], items[i] = key, item
    return size


def _crossings(vertices: Float, faces: Int32, lengths: Float, owner: Int) -> tuple[Int, Float]:
    """(M, 2) the owners of the two ends of the mesh's edges, and (M,) the way between them over the edge."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    pairs = pairs[owner[pairs[:, 0]] != owner[pairs[:, 1]]]
    a, b = pairs[:, 0], pairs[:, 1]
    across = lengths[a] + np.linalg.norm(vertices[a] - vertices[b], axis=1) + lengths[b]
    return owner[pairs], across


def _shortest(pairs: Int, lengths: Float) -> tuple[Int, Float]:
    """(B, 2) every pair of two nodes once, smaller number first, and (B,) the shortest of its lengths."""
    different = pairs[:, 0] != pairs[:, 1]
    pairs, lengths = np.sort(pairs[different], 1), lengths[different]
    order = np.lexsort((lengths, pairs[:, 1], pairs[:, 0]))
    pairs, lengths = pairs[order], lengths[order]
    first = np.ones(len(pairs), bool)
    first[1:] = (pairs[1:] != pairs[:-1]).any(1)
    return pairs[first], lengths[first]


def _adopt_orphans(vertices: Float, shell: Int, owner: Int, positions: Float) -> None:
    """Give each shell without a node, as a whole, to the node that is nearest to any of its vertices."""
    orphans = np.flatnonzero(owner < 0)
    if len(orphans) == 0:
        return
    length, nearest = cKDTree(positions).query(vertices[orphans])
    order = np.lexsort((length, shell[orphans]))
    label = shell[orphans][order]
    first = np.concatenate([[True], label[1:] != label[:-1]])
    node_of = np.full(int(shell.max()) + 1, -1, np.int64)
    node_of[label[first]] = nearest[order][first]
    owner[orphans] = node_of[shell[orphans]]
