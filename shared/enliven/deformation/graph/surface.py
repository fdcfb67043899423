"""Geodesic distances: shortest paths along a surface, and the Voronoi cells of a graph's nodes on it.

Two legs may be near in space and far apart along the surface. So these distances determine which nodes are
linked, and which nodes a vertex follows. Paths run over a *net* of points. If the mesh is coarse, the net is
the welded mesh, with edges that are halved until they are short enough. If it is fine, connected vertices
within one cell of a grid are merged to one point of the net. A million vertices then cost no more than ten
thousand. Two sheets that pass through the same cell, but are connected elsewhere, remain separate points. The
net also has links through thin parts, and across the seams between shells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from enliven.arrays import Float, Float32, Int, Int32
from enliven.deformation.graph import geodesic_kernels
from enliven.deformation.graph import surface_kernels as kernels
from enliven.deformation.graph.connectivity import label_components
from enliven.meshes import Mesh, longest_edge, split_long_edges, weld

_MAX_SUBDIVIDED_VERTICES = 200_000
"""Maximum number of vertices of a subdivided mesh, unless the mesh itself has more. This limits the memory
and time for the net."""
_CELLS_PER_SPACING = 6
"""Number of cells of the net per node spacing."""
_MAX_EDGE_IN_SPACINGS = 1 / 3
"""Maximum edge length, in node spacings. Longer edges are halved."""
_MIN_SOUP_TEST_POINTS = 20_000
"""Minimum number of points of a net that is tested for being a triangle soup. Smaller nets are fast in any
case."""
_MIN_SOUP_PIECES_PER_CELL = 6
"""Minimum mean number of separate pieces per cell for a net of more than 20,000 points to be a triangle
soup."""
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
        edges: (E, 2) int32 pairs of points, each once.
        lengths: (E,) metres, the length of each edge.
    """

    edges: Int32
    lengths: Float


@dataclass(frozen=True)
class SurfaceNet:
    """A net for paths along a surface: points, and links between them.

    Attributes:
        mesh: the surface that it represents.
        cell: metres, the side of the grid's cells.
        points: (C, 3) metres, the mean position of the vertices that each point represents.
        normals: (C, 3) outward unit normals; zero if no face with an area touches the point.
        radii: (C,) metres, the distance from each point to the farthest of its vertices.
        of_vertex: (V,) int32, the point that represents each vertex of the mesh.
        shell: (C,) the number of the shell that each point is on.
        graph: the links along the surface, through thin parts, and across seams.
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
        mesh: any triangle mesh.
        welded: the result of :func:`enliven.meshes.mesh.weld` for the mesh, if it is known.
    """
    welded_mesh, welded_of = welded or weld(mesh)
    vertices, faces, origin = _subdivide_mesh(welded_mesh, _MAX_EDGE_IN_SPACINGS * spacing)
    cell = spacing / _CELLS_PER_SPACING
    cells = kernels.grid_cells(vertices, cell)
    label, count = kernels.cluster_vertices(faces, cells)
    if count > _MIN_SOUP_TEST_POINTS:
        # A mesh of many tiny pieces has several pieces in each cell, and paths along them end after a short
        # way. So merge all points of a cell into one.
        occupied, cell_index = np.unique(cells, return_inverse=True)
        if count > _MIN_SOUP_PIECES_PER_CELL * len(occupied):
            label, count = cell_index.reshape(-1).astype(np.int32), len(occupied)
    points, radii = kernels.cluster_means(vertices, label, count)
    edges, normals = kernels.adjacent_clusters(vertices, faces, label, count)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(length > 0, length, 1.0)
    shell = label_components(count, edges)
    links = _shell_links(points, normals, shell, spacing)
    edges = np.concatenate([edges, links])
    graph = WeightedGraph(edges, np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1))
    return SurfaceNet(
        mesh, cell, points, normals, radii, label[welded_of], shell, graph, label, faces, origin
    )


def _subdivide_mesh(welded: Mesh, longest: float) -> tuple[Float, Int32, Int | None]:
    """Returns the vertices (W, 3) and faces (G, 3) of a subdivided mesh, and (G,) the original face that
    contains each face. The last is None if no face was subdivided.
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
    """Returns (L, 2) links between points that are near in space but not connected along the surface."""
    reach = max(_MAX_THROUGH_LINK_SPACINGS, _MAX_SEAM_LINK_SPACINGS, _MAX_TOUCH_LINK_SPACINGS) * spacing
    order, starts, neighbour_cells = kernels.sort_into_grid(points, reach)
    return np.asarray(
        kernels.link_near_points(
            points,
            normals,
            shell,
            order,
            starts,
            neighbour_cells,
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
        net: the net of the surface.
        graph: the net's edges, and the edges that connect the nodes to it. Node j is point C + j.
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

    A part of the surface without any node belongs as a whole to the node that is nearest in space.

    Args:
        net: the net of the mesh.
        positions: (N, 3) metres, the nodes.
        faces: (N,) the face of the mesh that each node lies on.
    """
    count = len(net.points)
    graph = _graph_with_nodes(net, positions, faces)
    sources = count + np.arange(len(positions))
    lengths, owner = geodesic_kernels.nearest_sources(
        *_adjacency_lists(graph, count + len(positions)), sources
    )
    owner = np.where(owner < 0, -1, owner - count)
    edge_owners = owner[graph.edges]
    crossing = (edge_owners[:, 0] != edge_owners[:, 1]) & (edge_owners >= 0).all(1)
    start, end = graph.edges[crossing].T
    borders, border_lengths = _shortest_pairs(
        edge_owners[crossing], lengths[start] + graph.lengths[crossing] + lengths[end]
    )
    return VoronoiCells(net, graph, owner[:count], borders, border_lengths)


def _graph_with_nodes(net: SurfaceNet, positions: Float, faces: Int32) -> WeightedGraph:
    """Returns the net's graph, with each node connected to the corners of its face, and each part without a
    node connected to the nearest node.
    """
    count = len(net.points)
    origin = np.arange(len(net.faces)) if net.origin is None else net.origin
    first, last = np.searchsorted(origin, faces), np.searchsorted(origin, faces, side="right")
    node = np.repeat(np.arange(len(faces)), (last - first) * 3)
    corner_vertices = np.concatenate(
        [net.faces[begin:end].reshape(-1) for begin, end in zip(first, last, strict=True)]
    )
    corner = net.label[corner_vertices]
    node_links = np.unique(np.stack([corner, count + node], 1), axis=0).astype(np.int32)
    part = label_components(count + len(faces), np.concatenate([net.graph.edges, node_links]))
    node_links = np.concatenate([node_links, _links_to_orphans(net.points, part, positions)])
    ends = np.concatenate([net.points, positions])
    lengths = np.linalg.norm(ends[node_links[:, 0]] - ends[node_links[:, 1]], axis=1)
    return WeightedGraph(
        np.concatenate([net.graph.edges, node_links]), np.concatenate([net.graph.lengths, lengths])
    )


def _links_to_orphans(points: Float, part: Int, positions: Float) -> Int32:
    """Returns (O, 2) a link for each part of the net without a node, from its nearest point to the nearest
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
    """Returns the neighbours of each point as CSR: offsets (count + 1,), neighbours (2 E,) and lengths (2
    E,)."""
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
        joints: (E, 2) pairs of linked nodes without a path between them. Their distance counts as ``spacing``
            metres.

    Returns:
        CSR over the points: offsets (C + 1,), nodes (K,) ascending at each point, and distances (K,) in
            metres.
    """
    count = len(cells.net.points)
    graph = WeightedGraph(
        np.concatenate([cells.graph.edges, (count + joints).astype(np.int32)]),
        np.concatenate([cells.graph.lengths, np.full(len(joints), spacing)]),
    )
    offsets, neighbours, lengths = _adjacency_lists(graph, int(graph.edges.max(initial=0)) + 1)
    while True:
        row_offsets, node_index, metres = geodesic_kernels.distances_from_sources(
            offsets, neighbours, lengths, count + nodes, count, reach
        )
        # On a long object with few nodes, some points may have no node within reach. In that case search
        # again without a limit.
        if (np.diff(row_offsets) > 0).all() or np.isinf(reach):
            return row_offsets, nodes.astype(np.int32)[node_index], metres
        reach = 4 * reach if reach < 100 * spacing else np.inf


def points_around(net: SurfaceNet, reach: float) -> tuple[Int, Int32, Float]:
    """Returns the points within ``reach`` metres of each point along the net, sorted by distance, starting
    with the point itself.

    Returns:
        CSR: offsets (C + 1,), points (K,) and distances (K,) in metres.
    """
    row_offsets, points, metres = geodesic_kernels.points_within(
        *_adjacency_lists(net.graph, len(net.points)), reach
    )
    return row_offsets, points, metres


def vertices_of_points(net: SurfaceNet) -> tuple[Int, Int32]:
    """Returns the vertices that each point of the net represents, as CSR: offsets (C + 1,) and vertices."""
    starts, order = kernels.group_by_label(net.of_vertex, len(net.points))
    return starts, order


def path_lengths(count: int, edges: Int, lengths: Float, limit: float = np.inf) -> Float:
    """Returns the length (N, N) in metres of the shortest path between nodes over weighted edges; infinite
    beyond ``limit`` metres.
    """
    if len(edges) == 0:
        return np.where(np.eye(count, dtype=bool), 0.0, np.inf)
    # Remove duplicate edges, because csr_matrix would add up their lengths.
    pairs, shortest_lengths = _shortest_pairs(edges.astype(np.int64), lengths)
    graph = scipy.sparse.csr_matrix(
        (np.maximum(shortest_lengths, 1e-12), (pairs[:, 0], pairs[:, 1])), (count, count)
    )
    return np.asarray(scipy.sparse.csgraph.dijkstra(graph, directed=False, limit=limit))


def _shortest_pairs(pairs: Int, lengths: Float) -> tuple[Int, Float]:
    """Returns (B, 2) every pair of two different nodes once, smaller number first, and (B,) the smallest of
    its lengths.
    """
    is_edge = pairs[:, 0] != pairs[:, 1]
    pairs, lengths = np.sort(pairs[is_edge], 1), lengths[is_edge]
    order = np.lexsort((lengths, pairs[:, 1], pairs[:, 0]))
    pairs, lengths = pairs[order], lengths[order]
    first = np.ones(len(pairs), bool)
    first[1:] = (pairs[1:] != pairs[:-1]).any(1)
    return pairs[first], lengths[first]
