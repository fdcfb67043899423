"""Places the transforms of a baked surface at seed vertices, spread by geodesic distances along edges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from enliven.arrays import Float, Int, Int32
from enliven.deformation.arap.weights import find_virtual_edges, surface_edges
from enliven.meshes import Mesh


class EdgeGraph:
    """The edge graph of a welded mesh. Separate shells are connected at their nearest vertices.

    Attributes:
        edges: (E, 2) vertices.
        lengths: (V, V) sparse matrix of edge lengths, metres.
    """

    def __init__(self, mesh: Mesh) -> None:
        count = len(mesh.vertices)
        edges, _ = surface_edges(mesh.vertices, mesh.faces)
        links, _ = find_virtual_edges(mesh.vertices, edges)
        self.edges = np.concatenate([edges, links])
        lengths = np.linalg.norm(mesh.vertices[self.edges[:, 0]] - mesh.vertices[self.edges[:, 1]], axis=1)
        # SciPy ignores edges with a length of exactly 0, so give each edge a tiny minimum length.
        lengths = np.maximum(lengths, 1e-12)
        half = coo_matrix((lengths, (self.edges[:, 0], self.edges[:, 1])), (count, count)).tocsr()
        self.lengths: csr_matrix = (half + half.T).tocsr()

    def compute_geodesic_distances(self, seeds: Sequence[int], limit: float = np.inf) -> Float:
        """Returns (S, V) geodesic distances along the edges from each seed, metres. Distances above the limit
        are infinite.
        """
        return np.asarray(dijkstra(self.lengths, directed=False, indices=list(seeds), limit=limit))


class Seeds:
    """Vertices with a transform, in the order in which they were added.

    Attributes:
        vertices: the seeds, as vertices of the welded mesh.
        away: (S, V) geodesic distances from each seed to each vertex, metres.
    """

    def __init__(self, net: EdgeGraph, held: Sequence[int], count: int) -> None:
        self._net = net
        first = list(dict.fromkeys(held)) or [0]
        self.vertices, self.away = first, net.compute_geodesic_distances(first)
        while len(self.vertices) < count and self._add_vertex(int(np.argmax(self.away.min(0)))):
            pass

    def grow(self, scores: Float, count: int) -> int:
        """Adds up to ``count`` seeds, each at the vertex with the highest remaining score (V,).

        A vertex is no longer a candidate if its distance to a new seed is less than half the distance from
        that seed to the nearest earlier seed.

        Returns:
            The number of added seeds.
        """
        remaining_scores, old_count = scores.copy(), len(self.vertices)
        remaining_scores[self.vertices] = 0.0
        while len(self.vertices) < old_count + count and remaining_scores.max(initial=0.0) > 0.0:
            chosen = int(np.argmax(remaining_scores))
            radius = 0.5 * float(self.away[:, chosen].min())
            self._add_vertex(chosen)
            remaining_scores[self.away[-1] <= radius] = 0.0
        return len(self.vertices) - old_count

    def find_nearest(self, count: int) -> Int32:
        """Returns the nearest seeds (V, C) of each vertex, nearest first. Missing entries are -1."""
        count_there = min(count, len(self.vertices))
        order = np.argsort(self.away, axis=0, kind="stable")[:count_there].T
        filled = np.full((self.away.shape[1], count), -1, np.int32)
        filled[:, :count_there] = order
        return filled

    def edges(self) -> Int32:
        """Returns (E, 2) pairs of seeds with adjacent Voronoi cells."""
        owner: Int = np.argmin(self.away, axis=0)
        pairs = np.sort(owner[self._net.edges], 1)
        return np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0).astype(np.int32).reshape(-1, 2)

    def _add_vertex(self, vertex: int) -> bool:
        if vertex in self.vertices:
            return False
        self.vertices.append(vertex)
        self.away = np.concatenate([self.away, self._net.compute_geodesic_distances([vertex])])
        return True
