"""The deformation graph: a few nodes on a surface, linked to their neighbours, which deform all vertices.

The method is from KinÊtre, "Orientation-Aware Sampling" and "Mesh Connectivity and Regularization".
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Bool, Float, Int, Int32
from enliven.deformation.graph.connectivity import find_joining_edges, find_weak_edges
from enliven.deformation.graph.sampling import (
    SurfaceSamples,
    distance_matrix,
    find_nearest_surface_points,
    sample_poisson_disk,
)
from enliven.deformation.graph.surface import (
    VoronoiCells,
    build_net,
    node_distances,
    path_lengths,
    voronoi_cells,
)
from enliven.deformation.graph.weights import (
    DETOUR_TOLERANCE_SPACINGS,
    MAX_DETOUR_RATIO,
    blending_weights,
    choose_followed_nodes,
)
from enliven.document import Character, SkinWeights
from enliven.errors import InputError
from enliven.meshes import Mesh, weld

NEIGHBOURS = 4
"""Number of neighbours of a node, and number of nodes that a point follows: the paper's k."""
_MAX_NEIGHBOUR_SPACINGS = 2.5
"""Maximum distance of a neighbour along the surface, in node spacings."""
_MAX_FOLLOW_SPACINGS = 4.5
"""Maximum distance along the surface from a vertex to a node that it follows, in node spacings."""


@dataclass(frozen=True)
class DeformationGraph:
    """A deformation graph: nodes and the edges between them. It is always connected.

    Attributes:
        positions: (N, 3) metres, the positions g_j of the nodes at rest.
        normals: (N, 3) outward unit normals of the surface.
        faces: (N,) the face of the mesh that each node lies on.
        edges: (E, 2) int32, pairs of nodes i < j, sorted.
        rigid: (E,) the edges of E_rig: bridges, and edges that join a part to a cut vertex.
        bridges: (E,) true for an edge that splits the graph when removed.
        cut_vertices: (N,) true for a node that splits the graph when removed.
        radius: the minimum distance R of the sampling in metres.
        cells: the nodes' Voronoi cells on the surface; None for a graph that was not built on a mesh.
    """

    positions: Float
    normals: Float
    faces: Int32
    edges: Int32
    rigid: Bool
    bridges: Bool
    cut_vertices: Bool
    radius: float
    cells: VoronoiCells | None = field(default=None, repr=False, compare=False)

    @staticmethod
    def build(mesh: Mesh, nodes: int = 128, seed: int = 0, radius: float | None = None) -> DeformationGraph:
        """Samples the mesh and links the samples. The same input always gives the same graph.

        Nodes are linked with their four nearest under D (eq. 6), with three additions to the paper:

        - Nodes that are near in space but not along the surface are not linked. Examples are nodes of two
          legs, and nodes of two shells with a gap between them.
        - If the surface bends much, few nodes have similar normals, and the four nodes nearest under D may be
          a metre away. So neighbours must lie within 2.5 node spacings along the surface. A node with fewer
          than four such neighbours also gets those that are nearest along the surface.
        - The two faces of a part thinner than half a node spacing are linked. Each node is linked with the
          nearest node on the opposite face. Thin parts then keep their thickness.

        Remaining components are joined by the minimum spanning tree over the components. Within a shell, its
        distances are those along the surface. Between shells they are D, or the Euclidean distance if D is
        infinite.

        Args:
            mesh: any triangles, in metres.
            nodes: the number of nodes, unless ``radius`` defines their spacing.
            seed: seed of the random sampling.
            radius: metres between nodes under D, or None.

        Raises:
            InputError: if the mesh has no area, or there is less than one node.
        """
        welded = weld(mesh)
        samples = sample_poisson_disk(mesh, nodes, radius, seed, welded)
        net = build_net(mesh, _mean_spacing(mesh.area, len(samples.positions)), welded)
        return _link_graph(samples, voronoi_cells(net, samples.positions, samples.faces))

    @staticmethod
    def from_nodes(mesh: Mesh, positions: Float, edges: Int32) -> DeformationGraph:
        """Returns the graph of given nodes, such as the nodes of a received character or of a part that was
        cut off.

        If the edges form several components, these are joined by edges between their nearest nodes.

        Args:
            positions: (N, 3) metres, on the mesh or near it.
            edges: (E, 2) pairs of nodes.

        Raises:
            InputError: if the mesh has no face, or no node is given.
        """
        if not len(mesh.faces) or not len(positions):
            problem = (
                f"a deformation graph needs faces and nodes, but the mesh has {len(mesh.faces)} faces "
                f"and {len(positions)} nodes were passed"
            )
            raise InputError(problem, where=mesh.name, remedy="Pass a mesh with faces and at least one node.")
        count, pairs = len(positions), np.sort(np.asarray(edges).reshape(-1, 2), 1)
        distances = np.linalg.norm(positions[:, None] - positions[None], axis=2)
        pairs = np.unique(
            np.concatenate([pairs, find_joining_edges(count, pairs, distances)]), axis=0
        ).astype(np.int32)
        bridges, cuts, hanging = find_weak_edges(count, pairs)
        near = find_nearest_surface_points(mesh, positions)
        return DeformationGraph(positions, near.normals, near.faces, pairs, hanging, bridges, cuts, 0.0)

    def skin(self, mesh: Mesh) -> SkinWeights:
        """Returns four nodes and weights for each vertex of the mesh that the graph was built on.

        If the graph was built on a refined mesh (see :func:`enliven.meshes.mesh.refine`), that mesh may be
        passed. :func:`enliven.deformation.graph.weights.blending_weights` explains the choice of the
        distance.
        """
        if int(self.faces.max()) >= len(mesh.faces):
            raise InputError(
                f"the graph refers to face {int(self.faces.max())}, but the mesh has only "
                f"{len(mesh.faces)} faces",
                where=mesh.name,
                remedy="Pass the mesh for which the graph was built.",
            )
        spacing = _mean_spacing(mesh.area, len(self.positions))
        cells = self.cells
        if cells is None or cells.net.mesh is not mesh:
            cells = voronoi_cells(build_net(mesh, spacing), self.positions, self.faces)
        surface_distances = path_lengths(len(self.positions), cells.borders, cells.lengths)
        followed = choose_followed_nodes(self.positions, surface_distances, spacing)
        leaps = self.edges[np.isinf(surface_distances[self.edges[:, 0], self.edges[:, 1]])]
        near = node_distances(cells, followed, leaps, spacing, _MAX_FOLLOW_SPACINGS * spacing)
        return blending_weights(cells.net, near, self.positions, spacing, NEIGHBOURS)


def graph_from_character(character: Character) -> DeformationGraph:
    """Returns the deformation graph of a character. It depends only on transmitted data, so it is the same on
    every machine."""
    mesh = Mesh(np.asarray(character.vertices, np.float64), character.faces, character.id)
    return DeformationGraph.from_nodes(mesh, np.asarray(character.pivots, np.float64), character.edges)


def character_from_graph(mesh: Mesh, graph: DeformationGraph, id: str) -> Character:
    """Returns the mesh as a character with the nodes of ``graph`` as its transforms."""
    return Character(
        id,
        mesh.vertices.astype(np.float32),
        mesh.faces,
        graph.skin(mesh),
        graph.positions.astype(np.float32),
        graph.edges,
        "graph",
        None if mesh.colours is None else np.ascontiguousarray(mesh.colours[:, :3]),
        materials=mesh.materials,
        stiffness=mesh.stiffness,
    )


def _mean_spacing(area: float, count: int) -> float:
    """Returns the mean spacing of nodes, metres: the paper's R = sqrt(A / N)."""
    return float(np.sqrt(area / count))


def _find_opposite_face_nodes(positions: Float, normals: Float, spacing: float) -> Bool:
    """Returns (N, N) true for nodes on the two faces of a part that is thinner than half the node spacing.

    Each of two such nodes is behind the other's surface, at a small depth. (The nodes of two adjacent legs
    are in front of each other's surface.)
    """
    offsets = positions[None] - positions[:, None]
    depth = -np.einsum("ija,ia->ij", offsets, normals)
    is_behind = (depth > 0) & (depth < spacing / 2)
    return np.asarray(is_behind & is_behind.T & (np.linalg.norm(offsets, axis=2) < 2 * spacing))


def _link_graph(samples: SurfaceSamples, cells: VoronoiCells) -> DeformationGraph:
    """Returns the graph that links the samples with their neighbours."""
    count = len(samples.positions)
    spacing = _mean_spacing(cells.net.mesh.area, count)
    distances = distance_matrix(samples)
    straight_distances = np.linalg.norm(samples.positions[:, None] - samples.positions[None], axis=2)
    surface_distances = path_lengths(count, cells.borders, cells.lengths)
    detours = surface_distances > MAX_DETOUR_RATIO * straight_distances + DETOUR_TOLERANCE_SPACINGS * spacing
    is_far = detours | (surface_distances > _MAX_NEIGHBOUR_SPACINGS * spacing)
    # Pairs that are far apart, or at an infinite distance D, come after all other pairs. They are sorted by
    # the length of the path along the surface. Pairs with a detour are never linked here.
    surface_ranking = np.where(
        detours, np.inf, distances[np.isfinite(distances)].max(initial=0.0) + surface_distances
    )
    np.fill_diagonal(surface_ranking, np.inf)
    edges = _find_nearest_edges(
        np.where(is_far | np.isinf(distances), surface_ranking, distances), NEIGHBOURS
    )
    is_opposite = _find_opposite_face_nodes(samples.positions, samples.normals, spacing) & ~detours
    opposite_distances = np.where(is_opposite, straight_distances, np.inf)
    edges = np.concatenate([edges, _find_nearest_edges(opposite_distances, 1)])
    shell_distances = np.where(np.isfinite(distances), distances, straight_distances)
    # Prefer paths along the surface: make every link between shells longer than all of these paths.
    longest_path = float(surface_distances[np.isfinite(surface_distances)].max(initial=0.0))
    link_lengths = np.where(np.isfinite(surface_distances), surface_distances, longest_path + shell_distances)
    edges = np.concatenate([edges, find_joining_edges(count, edges, link_lengths)])
    edges = np.unique(edges, axis=0).astype(np.int32)
    bridges, cuts, hanging = find_weak_edges(count, edges)
    return DeformationGraph(
        samples.positions,
        samples.normals,
        samples.faces,
        edges,
        hanging,
        bridges,
        cuts,
        samples.radius,
        cells,
    )


def _find_nearest_edges(distances: Float, k: int) -> Int32:
    """Returns (E, 2) undirected edges i < j from every node to its k nearest nodes at a finite distance."""
    k = min(k, len(distances) - 1)
    if k < 1:
        return np.empty((0, 2), np.int32)
    nearest: Int = np.argpartition(distances, k - 1, axis=1)[:, :k]
    rows = np.repeat(np.arange(len(distances)), k)
    pairs = np.stack([rows, nearest.reshape(-1)], 1)
    pairs = pairs[np.isfinite(distances[pairs[:, 0], pairs[:, 1]])]
    return np.unique(np.sort(pairs, 1), axis=0).astype(np.int32).reshape(-1, 2)
