"""Geodesic distances: shortest paths along a surface, and the Voronoi cells of a graph's nodes on it.

Two legs may be near in space and far apart along the surface. So nodes are linked, and vertices follow nodes,
by these distances. Paths run over a *net*. If the mesh is coarse, the net is the welded mesh's edges, halved
until they are short enough. If it is fine, connected vertices within one cell of a grid become one point of
the net. A million vertices then cost no more than ten thousand. Two sheets that pass through the same cell,
but are connected elsewhere, remain separate points. The net also has links through thin parts, and across the
seams between shells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from enliven.arrays import Float, Float32, Int, Int32
from enliven.deformation.graph import geodesic_kernels
from enliven.deformation.graph import surface_kernels as kernels
from enliven.deformation.graph.connectivity import components
from enliven.meshes import Mesh, longest_edge, split_long_edges, weld

_MAX_SUBDIVIDED_VERTICES = 200_000
"""Maximum number of vertices of a subdivided mesh, unless the mesh itself has more. It bounds the net's
memory and time."""
_CELLS_PER_SPACING = 6
"""Number of cells of the net per node spacing."""
_MAX_EDGE_IN_SPACINGS = 1 / 3
"""Maximum edge length, in node spacings. Longer edges are halved."""
_MIN_SOUP_TEST_POINTS = 20_000
"""Minimum number of points for testing whether a net is a triangle soup. A smaller net is cheap in any
case."""
_MIN_SOUP_PIECES_PER_CELL = 6
"""Minimum mean number of pieces per cell for a net of more than 20,000 points to count as a triangle soup."""
_MAX_THROUGH_LINK_SPACINGS = 1 / 2
"""Maximum distance, in spacings, of two points on opposite sides of a thin part that are linked through the
part."""
_MAX_SEAM_LINK_SPACINGS = 1 / 2
"""Maximum distance, in spacings, of linked points of two shells if one shell continues the other across a
seam."""
_MAX_TOUCH_LINK_SPACINGS = 1 / 10
"""Maximum distance, in spacings, of linked points of two touching shells with any orientation."""


class WeightedGraph(NamedTuple):
    """A weighted undirected graph over points.

    Attributes:
        edges: (E, 2) int32, each once.
        lengths: (E,) metres.
    """

    edges: Int32
    lengths: Float


@dataclass(frozen=True)
class SurfaceNet:
    """A net: the points and links for paths along a surface.

    Attributes:
        mesh: the surface that it represents.
        cell: metres, the side of the grid's cells.
        points: (C, 3) metres: means of the vertices that each point represents.
        normals: (C, 3) unit, outward; zero if no face with an area touches the point.
        radii: (C,) metres, from each point to the farthest of its vertices.
        of_vertex: (V,) int32, the point that represents each vertex of the mesh.
        shell: (C,) the number of the shell that each point is on.
        graph: along the surface, through thin parts, and across seams.
        label: (W,) int32, the point that represents each vertex of the welded and subdivided mesh with W
            vertices.
        faces: (G, 3) the faces of that mesh.
        origin: (G,) the original face that contains each face, ascending. None if no face was subdivided.
    """

    mesh: Mesh
    cell: float
    points: Float
    normals: Float
    radii: Float32
    of_vertex: Int32
    shell: Int
    graph: WeightedGraph
    label: Int32
    faces: Int32
    origin: Int | None


def build_net(mesh: Mesh, spacing: float, welded: tuple[Mesh, Int] | None = None) -> SurfaceNet:
    """Returns the net of a mesh, for nodes about ``spacing`` metres apart.

    Args:
        mesh: any triangles.
        welded: the result of :func:`enliven.meshes.mesh.weld` for the mesh, if it is known.
    """
    whole, welded_of = welded or weld(mesh)
    vertices, faces, origin = _subdivided_mesh(whole, _MAX_EDGE_IN_SPACINGS * spacing)
    cell = spacing / _CELLS_PER_SPACING
    cells = kernels.grid_cells(vertices, cell)
    label, count = kernels.clusters(faces, cells)
    if count > _MIN_SOUP_TEST_POINTS:
        # A mesh of many tiny pieces has several pieces in each cell, and paths along them lead nowhere. So
        # merge all points of a cell into one.
        occupied, by_cell = np.unique(cells, return_inverse=True)
        if count > _MIN_SOUP_PIECES_PER_CELL * len(occupied):
            label, count = by_cell.reshape(-1).astype(np.int32), len(occupied)
    points, radii = kernels.means(vertices, label, count)
    edges, normals = kernels.joined(vertices, faces, label, count)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(length > 0, length, 1.0)
    shell = components(count, edges)
    links = _shell_links(points, normals, shell, spacing)
    edges = np.concatenate([edges, links])
    graph = WeightedGraph(edges, np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1))
    return SurfaceNet(
        mesh, cell, points, normals, radii, label[welded_of], shell, graph, label, faces, origin
    )


def _subdivided_mesh(welded: Mesh, longest: float) -> tuple[Float, Int32, Int | None]:
    """Returns the vertices and faces of a finer mesh, and each face's number in the given mesh (None: the
    same).
    """
    vertices, faces = welded.vertices, welded.faces
    origin: Int | None = None
    while longest_edge(vertices, faces) > longest:
        finer, split, _, source = split_long_edges(vertices, faces, longest)
        if len(finer) > max(_MAX_SUBDIVIDED_VERTICES, len(welded.vertices)):
            break
        vertices, faces, origin = finer, split, source if origin is None else origin[source]
    return vertices, faces, origin


def _shell_links(points: Float, normals: Float, shell: Int, spacing: float) -> Int32:
    """Returns (L, 2) pairs of points that are near in space but not connected along the surface."""
    reach = max(_MAX_THROUGH_LINK_SPACINGS, _MAX_SEAM_LINK_SPACINGS, _MAX_TOUCH_LINK_SPACINGS) * spacing
    order, starts, around = kernels.grid(points, reach)
    return np.asarray(
        kernels.near_pairs(
            points,
            normals,
            shell,
            order,
            starts,
            around,
            np.array(
                [
                    _MAX_THROUGH_LINK_SPACINGS * spacing,
                    _MAX_SEAM_LINK_SPACINGS * spacing,
                    _MAX_TOUCH_LINK_SPACINGS * spacing,
                ]
            ),
        ),
        np.int32,
    )


@dataclass(frozen=True)
class VoronoiCells:
    """The Voronoi cells of nodes on a surface, by distances along its net.

    Attributes:
        net: the surface.
        graph: the net's edges, and those that connect the nodes; node j is point C + j.
        owner: (C,) the node nearest to each point of the net, along the surface.
        borders: (B, 2) pairs of nodes with adjacent cells.
        lengths: (B,) metres, the shortest path between the two nodes across their border.
    """

    net: SurfaceNet
    graph: WeightedGraph
    owner: Int
    borders: Int
    lengths: Float


def voronoi_cells(net: SurfaceNet, positions: Float, faces: Int32) -> VoronoiCells:
    """Splits the surface between nodes by distance along it (a geodesic Voronoi diagram).

    A part without any node belongs, as a whole, to the node that is nearest in space.

    Args:
        net: of the mesh.
        positions: (N, 3) metres, the nodes.
        faces: (N,) the face of the mesh that each node lies on.
    """
    count = len(net.points)
    graph = _graph_with_nodes(net, positions, faces)
    sources = count + np.arange(len(positions))
    lengths, owner = geodesic_kernels.spread(*_adjacency_lists(graph, count + len(positions)), sources)
    owner = np.where(owner < 0, -1, owner - count)
    ends = owner[graph.edges]
    crossing = (ends[:, 0] != ends[:, 1]) & (ends >= 0).all(1)
    a, b = graph.edges[crossing].T
    borders, across = _shortest_pairs(ends[crossing], lengths[a] + graph.lengths[crossing] + lengths[b])
    return VoronoiCells(net, graph, owner[:count], borders, across)


def _graph_with_nodes(net: SurfaceNet, positions: Float, faces: Int32) -> WeightedGraph:
    """Returns the net's graph with each node connected to the corners of its face, and each part without a
    node to one.
    """
    count = len(net.points)
    origin = np.arange(len(net.faces)) if net.origin is None else net.origin
    first, last = np.searchsorted(origin, faces), np.searchsorted(origin, faces, side="right")
    node = np.repeat(np.arange(len(faces)), (last - first) * 3)
    inside = np.concatenate([net.faces[a:b].reshape(-1) for a, b in zip(first, last, strict=True)])
    corner = net.label[inside]
    ties = np.unique(np.stack([corner, count + node], 1), axis=0).astype(np.int32)
    part = components(count + len(faces), np.concatenate([net.graph.edges, ties]))
    ties = np.concatenate([ties, _links_to_orphans(net.points, part, positions)])
    ends = np.concatenate([net.points, positions])
    lengths = np.linalg.norm(ends[ties[:, 0]] - ends[ties[:, 1]], axis=1)
    return WeightedGraph(
        np.concatenate([net.graph.edges, ties]), np.concatenate([net.graph.lengths, lengths])
    )


def _links_to_orphans(points: Float, part: Int, positions: Float) -> Int32:
    """Returns (O, 2) one connection, from its nearest point to the nearest node, for each part without a
    node.
    """
    count = len(points)
    orphans = np.flatnonzero(~np.isin(part[:count], part[count:]))
    if len(orphans) == 0:
        return np.empty((0, 2), np.int32)
    length, nearest = scipy.spatial.cKDTree(positions).query(points[orphans])
    order = np.lexsort((length, part[orphans]))
    label = part[orphans][order]
    first = np.concatenate([[True], label[1:] != label[:-1]])
    return np.stack([orphans[order][first], count + nearest[order][first]], 1).astype(np.int32)


def _adjacency_lists(graph: WeightedGraph, count: int) -> tuple[Int, Int32, Float]:
    """Returns CSR neighbours of each point: offsets (count + 1,), neighbours and lengths (2 E,)."""
    rows, columns = np.concatenate([graph.edges, graph.edges[:, ::-1]]).T
    order = np.argsort(rows, kind="stable")
    offsets = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=count))])
    return offsets, columns[order], np.concatenate([graph.lengths, graph.lengths])[order]


def node_distances(
    cells: VoronoiCells, nodes: Int, joints: Int32, spacing: float, reach: float
) -> tuple[Int, Int32, Float]:
    """Returns the nodes within ``reach`` metres of each point of the net along the surface, and their
    distances.

    If a point has no such node, the reach is increased for all points.

    Args:
        nodes: (M,) the nodes that are considered, ascending.
        joints: (E, 2) pairs of linked nodes without a path between them. They count as ``spacing`` metres
            apart.

    Returns:
        CSR over the points: offsets (C + 1,), nodes (K,) ascending at each point, and metres (K,).
    """
    count = len(cells.net.points)
    graph = WeightedGraph(
        np.concatenate([cells.graph.edges, (count + joints).astype(np.int32)]),
        np.concatenate([cells.graph.lengths, np.full(len(joints), spacing)]),
    )
    offsets, neighbours, lengths = _adjacency_lists(graph, int(graph.edges.max(initial=0)) + 1)
    while True:
        ends, which, metres = geodesic_kernels.ways(offsets, neighbours, lengths, count + nodes, count, reach)
        # On a long object with few nodes, some points may have no node within reach. In that case search
        # again without a limit.
        if (np.diff(ends) > 0).all() or np.isinf(reach):
            return ends, nodes.astype(np.int32)[which], metres
        reach = 4 * reach if reach < 100 * spacing else np.inf


def points_around(net: SurfaceNet, reach: float) -> tuple[Int, Int32, Float]:
    """Returns the points within ``reach`` metres along the net of each point, itself first, then the nearest.

    Returns:
        CSR: offsets (C + 1,), points (K,) and metres (K,).
    """
    ends, points, metres = geodesic_kernels.around(*_adjacency_lists(net.graph, len(net.points)), reach)
    return ends, points, metres


def vertices_of_points(net: SurfaceNet) -> tuple[Int, Int32]:
    """Returns the vertices that each point of the net represents, as CSR: offsets (C + 1,) and vertices."""
    starts, order = kernels.by_label(net.of_vertex, len(net.points))
    return starts, order


def path_lengths(count: int, edges: Int, lengths: Float, limit: float = np.inf) -> Float:
    """Returns (N, N) the shortest path between nodes over weighted edges; infinite beyond ``limit``
    metres.
    """
    if len(edges) == 0:
        return np.where(np.eye(count, dtype=bool), 0.0, np.inf)
    # Remove duplicate edges, because csr_matrix would add up their lengths.
    pairs, shortest = _shortest_pairs(edges.astype(np.int64), lengths)
    graph = csr_matrix((np.maximum(shortest, 1e-12), (pairs[:, 0], pairs[:, 1])), (count, count))
    return np.asarray(dijkstra(graph, directed=False, limit=limit))


def _shortest_pairs(pairs: Int, lengths: Float) -> tuple[Int, Float]:
    """Returns (B, 2) every pair of two nodes once, smaller number first, and (B,) the shortest of its
    lengths.
    """
    different = pairs[:, 0] != pairs[:, 1]
    pairs, lengths = np.sort(pairs[different], 1), lengths[different]
    order = np.lexsort((lengths, pairs[:, 1], pairs[:, 0]))
    pairs, lengths = pairs[order], lengths[order]
    first = np.ones(len(pairs), bool)
    first[1:] = (pairs[1:] != pairs[:-1]).any(1)
    return pairs[first], lengths[first]
