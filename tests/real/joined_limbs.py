"""Independent checks that a graph does not connect unrelated limbs, and a plain graph for comparison.

The two checks share no code with the product:

- :func:`detours`: an edge is wrong if the shortest path over the mesh's edges is three times as long as the
  edge and longer than two node spacings, and the edge's middle is in front of the nearest surface. (The path
  around a board is also long, but its two sides do belong together.)
- :class:`Limbs`: the mesh below a height (or far from the middle) consists of separate legs. An edge is wrong
  if its nodes are on two of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from enliven.deformation.graph.sampling import sample_uniform_points
from enliven.document.character import SkinWeights
from enliven.meshes.files import load_mesh
from enliven.meshes.mesh import Mesh, fit_height, refine, weld


class Case(NamedTuple):
    """A mesh, its number of limbs, and a rule for its limb vertices.

    Attributes:
        name: name of the file.
        limbs: number of limbs.
        cut: fraction of the height below which there are only legs; or, if negative, fraction of the greatest
            distance from the middle beyond which there are only arms.
    """

    name: str
    limbs: int
    cut: float


CASES = (
    Case("horse_quad.obj", 4, 0.35),
    Case("house_interior_pack_Chair_1.glb", 4, 0.30),
    Case("humanoid.off", 2, 0.40),
    Case("human_man.obj", 2, 0.40),
    Case("armadillo.obj", 2, 0.20),
    Case("trex_yana.obj", 2, 0.20),
    Case("octopus.obj", 8, -0.50),
)


def load(data, case: Case) -> Mesh:
    """Returns the mesh, 1.75 m tall, subdivided finely enough to bend."""
    path = next(p for kind in ("meshes", "gltf") for p in sorted(data.glob(f"{kind}/**/{case.name}")))
    return refine(fit_height(load_mesh(path).mesh, 1.75), 0.04)


def detours(mesh: Mesh, positions, edges) -> int:
    """Returns the number of wrong edges across a detour. Nodes are mapped to their nearest vertices."""
    whole, _ = weld(mesh)
    ends = np.concatenate([whole.faces[:, [0, 1]], whole.faces[:, [1, 2]], whole.faces[:, [2, 0]]])
    ends = np.unique(np.sort(ends, 1), axis=0)
    lengths = np.linalg.norm(whole.vertices[ends[:, 0]] - whole.vertices[ends[:, 1]], axis=1)
    web = csr_matrix((lengths, ends.T), (len(whole.vertices),) * 2)
    nearest = cKDTree(whole.vertices).query(positions)[1]
    starts, which = np.unique(edges[:, 0], return_inverse=True)
    ways = dijkstra(web, directed=False, indices=nearest[starts])[which, nearest[edges[:, 1]]]
    straight = np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1)
    spacing = np.sqrt(mesh.area / len(positions))
    middle = positions[edges].mean(1)
    face = cKDTree(mesh.vertices[mesh.faces].mean(1)).query(middle)[1]
    before = ((middle - mesh.vertices[mesh.faces[face]].mean(1)) * mesh.face_normals()[face]).sum(1) > 0
    return int((np.isfinite(ways) & (ways > 3 * straight) & (ways > 2 * spacing) & before).sum())


@dataclass(frozen=True)
class Limbs:
    """The limbs of a mesh: (V,) limb number of each vertex, -1 on the body."""

    mesh: Mesh
    of_vertex: np.ndarray

    @staticmethod
    def of(mesh: Mesh, case: Case) -> Limbs:
        """Returns the limbs of a case: its largest connected pieces beyond the cut."""
        welded, welded_of = weld(mesh)
        if case.cut > 0:
            outside = welded.vertices[:, 1] < case.cut * welded.vertices[:, 1].max()
        else:
            away = np.linalg.norm(welded.vertices - welded.vertices.mean(0), axis=1)
            outside = away > -case.cut * away.max()
        faces = welded.faces[outside[welded.faces].all(1)]
        pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
        web = csr_matrix((np.ones(len(pairs)), pairs.T), (len(outside),) * 2)
        piece = connected_components(web, directed=False)[1]
        sizes = np.bincount(piece[outside])
        largest = np.argsort(-sizes)[: case.limbs]
        assert sizes[largest].min() > 0.02 * outside.sum(), f"{case.name} has fewer limbs beyond the cut"
        number = np.full(len(sizes), -1)
        number[largest] = np.arange(case.limbs)
        limb_of = np.where(outside, number[np.minimum(piece, len(number) - 1)], -1)
        return Limbs(mesh, limb_of[welded_of])

    def of_points(self, positions) -> np.ndarray:
        """Returns (N,) limb numbers of points on the surface."""
        return self.of_vertex[cKDTree(self.mesh.vertices).query(positions)[1]]

    def joined(self, positions, edges) -> int:
        """Returns the number of edges from one limb to another."""
        a, b = self.of_points(positions)[edges].T
        return int(((a >= 0) & (b >= 0) & (a != b)).sum())

    def misled(self, positions, skin, least: float = 0.01) -> int:
        """Returns the number of limb vertices with more than ``least`` of their weight on another limb's
        nodes.
        """
        of_node = self.of_points(positions)[skin.indices.astype(int)]
        own = self.of_vertex[:, None]
        foreign = ((own >= 0) & (of_node >= 0) & (own != of_node)) * skin.weights
        return int((foreign.sum(1) > least).sum())


class PlainGraph(NamedTuple):
    """Nodes and edges of R. W. Sumner et al., "Embedded deformation for shape manipulation" (2007)."""

    positions: np.ndarray
    edges: np.ndarray


def plain_graph(mesh: Mesh, nodes: int, seed: int = 0) -> PlainGraph:
    """Returns Poisson-disk samples under the Euclidean distance, each linked with its four nearest."""
    rng = np.random.default_rng(seed)
    darts = rng.permutation(sample_uniform_points(mesh, 80 * nodes, rng).positions)
    low, high = 0.0, 4 * np.sqrt(mesh.area / nodes)
    for _ in range(20):
        middle = (low + high) / 2
        kept = _spaced(darts, middle)
        low, high = (middle, high) if len(kept) >= nodes else (low, middle)
    positions = _spaced(darts, low)[:nodes]
    nearest = cKDTree(positions).query(positions, 5)[1][:, 1:]
    pairs = np.stack([np.repeat(np.arange(nodes), 4), nearest.ravel()], 1)
    return PlainGraph(positions, np.unique(np.sort(pairs, 1), axis=0))


def _spaced(darts, radius):
    """Returns the darts, in order, that are at least ``radius`` apart."""
    if radius <= 0:
        return darts
    free = np.ones(len(darts), bool)
    tree, kept = cKDTree(darts), []
    for i in range(len(darts)):
        if free[i]:
            kept.append(i)
            free[tree.query_ball_point(darts[i], radius)] = False
    return darts[kept]


def plain_skin(mesh: Mesh, graph: PlainGraph):
    """Returns the four nearest nodes of each vertex by Euclidean distance, and the paper's linear weights."""
    lengths, nearest = cKDTree(graph.positions).query(mesh.vertices, 5)
    fall = 1 - lengths[:, :4] / lengths[:, 4:]
    weights = fall / fall.sum(1, keepdims=True)
    return SkinWeights(nearest[:, :4].astype(np.uint16), weights.astype(np.float32))
