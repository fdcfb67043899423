"""Geodesic distances: shortest paths along a surface, and the Voronoi cells of a graph's nodes on it.

Two legs may be near in space and far along the surface, so nodes are linked, and vertices follow nodes, by
these distances. Paths run over a *net*. Where the mesh is coarse, the net is the welded mesh's edges, halved
until they are short enough. Where it is fine, connected vertices within one cell of a grid become one point
of the net, so that a million vertices cost no more than ten thousand; a cell never joins two sheets that meet
elsewhere. The net also has links through thin parts, and across the seams between shells.
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

_MOST_VERTICES = 200_000
"""Vertices of a halved mesh at most, unless the mesh itself has more: it bounds the net's memory and time."""
_CELLS = 6
"""Cells of the net along one node spacing."""
_LONGEST = 1 / 3
"""Edges are halved until they are shorter than this many node spacings."""
_CROWDED = 20_000
"""Points from which on a net is tested for being a triangle soup; a smaller one is cheap in any case."""
_PIECES = 6
"""Pieces to a cell, in the mean, from which on a net of more than 20,000 points is a soup's."""
_THIN = 1 / 2
"""Two points that lie behind each other are linked where they are nearer than this many spacings."""
_SEAM = 1 / 2
"""The same, for points of two shells where one continues the other."""
_TOUCH = 1 / 10
"""The same, for points of two shells whichever way they face."""


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
    """A net: the points and links that paths along a surface run over.

    Attributes:
        mesh: the surface it stands for.
        cell: metres, the side of the grid's cells.
        points: (C, 3) metres: means of the vertices that each stands for.
        normals: (C, 3) unit, outward; zero where no face of any area touches.
        radii: (C,) metres, from each point to the farthest of its vertices.
        of_vertex: (V,) int32, the point that stands for each vertex of the mesh.
        shell: (C,) the number of the shell that each point is on.
        graph: along the surface, through thin parts, and across seams.
        label: (W,) int32, the point that stands for each vertex of the welded and cut mesh.
        faces: (G, 3) the faces of that mesh.
        origin: (G,) the mesh's face that each was cut from, ascending; None where none was cut.
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


def net_of(mesh: Mesh, spacing: float, welded: tuple[Mesh, Int] | None = None) -> SurfaceNet:
    """The net of a mesh, for nodes about ``spacing`` metres apart.

    Args:
        mesh: any triangles.
        welded: what :func:`enliven.meshes.mesh.weld` makes of the mesh, where it is known.
    """
    whole, welded_of = welded or weld(mesh)
    vertices, faces, origin = _halved(whole, _LONGEST * spacing)
    cell = spacing / _CELLS
    cells = kernels.grid_cells(vertices, cell)
    label, count = kernels.clusters(faces, cells)
    if count > _CROWDED:
        # A soup of tiny pieces has many to a cell, and none leads anywhere: then a cell is one point.
        occupied, by_cell = np.unique(cells, return_inverse=True)
        if count > _PIECES * len(occupied):
            label, count = by_cell.reshape(-1).astype(np.int32), len(occupied)
    points, radii = kernels.means(vertices, label, count)
    edges, normals = kernels.joined(vertices, faces, label, count)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(length > 0, length, 1.0)
    shell = components(count, edges)
    links = _links(points, normals, shell, spacing)
    edges = np.concatenate([edges, links])
    graph = WeightedGraph(edges, np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1))
    return SurfaceNet(
        mesh, cell, points, normals, radii, label[welded_of], shell, graph, label, faces, origin
    )


def _halved(welded: Mesh, longest: float) -> tuple[Float, Int32, Int | None]:
    """The vertices and faces of a finer mesh, and each face's number in the mesh given (None: the same)."""
    vertices, faces = welded.vertices, welded.faces
    origin: Int | None = None
    while longest_edge(vertices, faces) > longest:
        finer, split, _, source = split_long_edges(vertices, faces, longest)
        if len(finer) > max(_MOST_VERTICES, len(welded.vertices)):
            break
        vertices, faces, origin = finer, split, source if origin is None else origin[source]
    return vertices, faces, origin


def _links(points: Float, normals: Float, shell: Int, spacing: float) -> Int32:
    """(L, 2) pairs of points that are near although no way along the surface says so."""
    reach = max(_THIN, _SEAM, _TOUCH) * spacing
    order, starts, around = kernels.grid(points, reach)
    return np.asarray(
        kernels.near_pairs(
            points,
            normals,
            shell,
            order,
            starts,
            around,
            np.array([_THIN * spacing, _SEAM * spacing, _TOUCH * spacing]),
        ),
        np.int32,
    )


@dataclass(frozen=True)
class VoronoiCells:
    """The Voronoi cells of nodes on a surface, by distances along its net.

    Attributes:
        net: the surface.
        graph: the net's edges, and those that tie the nodes in; node j is point C + j.
        owner: (C,) the node nearest to each point of the net, along the surface.
        borders: (B, 2) pairs of nodes with adjacent cells.
        lengths: (B,) metres, the shortest way between the two across their border.
    """

    net: SurfaceNet
    graph: WeightedGraph
    owner: Int
    borders: Int
    lengths: Float


def voronoi_cells(net: SurfaceNet, positions: Float, faces: Int32) -> VoronoiCells:
    """Split the surface between nodes by distance along it (a geodesic Voronoi diagram).

    A part without any node goes, as a whole, to the node that is nearest in space.

    Args:
        net: of the mesh.
        positions: (N, 3) metres, the nodes.
        faces: (N,) the face of the mesh that each node lies on.
    """
    count = len(net.points)
    graph = _tied(net, positions, faces)
    sources = count + np.arange(len(positions))
    lengths, owner = geodesic_kernels.spread(*_adjacency(graph, count + len(positions)), sources)
    owner = np.where(owner < 0, -1, owner - count)
    ends = owner[graph.edges]
    crossing = (ends[:, 0] != ends[:, 1]) & (ends >= 0).all(1)
    a, b = graph.edges[crossing].T
    borders, across = _shortest(ends[crossing], lengths[a] + graph.lengths[crossing] + lengths[b])
    return VoronoiCells(net, graph, owner[:count], borders, across)


def _tied(net: SurfaceNet, positions: Float, faces: Int32) -> WeightedGraph:
    """The net's graph with each node tied to the corners of its face, and each part without a node to one."""
    count = len(net.points)
    origin = np.arange(len(net.faces)) if net.origin is None else net.origin
    first, last = np.searchsorted(origin, faces), np.searchsorted(origin, faces, side="right")
    node = np.repeat(np.arange(len(faces)), (last - first) * 3)
    inside = np.concatenate([net.faces[a:b].reshape(-1) for a, b in zip(first, last, strict=True)])
    corner = net.label[inside]
    ties = np.unique(np.stack([corner, count + node], 1), axis=0).astype(np.int32)
    part = components(count + len(faces), np.concatenate([net.graph.edges, ties]))
    ties = np.concatenate([ties, _adoptions(net.points, part, positions)])
    ends = np.concatenate([net.points, positions])
    lengths = np.linalg.norm(ends[ties[:, 0]] - ends[ties[:, 1]], axis=1)
    return WeightedGraph(
        np.concatenate([net.graph.edges, ties]), np.concatenate([net.graph.lengths, lengths])
    )


def _adoptions(points: Float, part: Int, positions: Float) -> Int32:
    """(O, 2) one tie, from its nearest point to the nearest node, for each part without a node."""
    count = len(points)
    orphans = np.flatnonzero(~np.isin(part[:count], part[count:]))
    if len(orphans) == 0:
        return np.empty((0, 2), np.int32)
    length, nearest = scipy.spatial.cKDTree(positions).query(points[orphans])
    order = np.lexsort((length, part[orphans]))
    label = part[orphans][order]
    first = np.concatenate([[True], label[1:] != label[:-1]])
    return np.stack([orphans[order][first], count + nearest[order][first]], 1).astype(np.int32)


def _adjacency(graph: WeightedGraph, count: int) -> tuple[Int, Int32, Float]:
    """CSR neighbours of each point: offsets (count + 1,), neighbours and lengths (2 E,)."""
    rows, columns = np.concatenate([graph.edges, graph.edges[:, ::-1]]).T
    order = np.argsort(rows, kind="stable")
    offsets = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=count))])
    return offsets, columns[order], np.concatenate([graph.lengths, graph.lengths])[order]


def ways_from_nodes(
    cells: VoronoiCells, nodes: Int, joints: Int32, spacing: float, reach: float
) -> tuple[Int, Int32, Float]:
    """Which nodes lie within ``reach`` metres of each point of the net along the surface, and how far.

    Where that leaves a point without any, the reach is longer for all.

    Args:
        nodes: (M,) the nodes that are asked for, ascending.
        joints: (E, 2) pairs of nodes between which no way leads; they count as ``spacing`` metres apart.

    Returns:
        CSR over the points: offsets (C + 1,), nodes (K,) ascending at each point, and metres (K,).
    """
    count = len(cells.net.points)
    graph = WeightedGraph(
        np.concatenate([cells.graph.edges, (count + joints).astype(np.int32)]),
        np.concatenate([cells.graph.lengths, np.full(len(joints), spacing)]),
    )
    offsets, neighbours, lengths = _adjacency(graph, int(graph.edges.max(initial=0)) + 1)
    while True:
        ends, which, metres = geodesic_kernels.ways(offsets, neighbours, lengths, count + nodes, count, reach)
        # Few nodes on a long thing may leave a point alone.
        if (np.diff(ends) > 0).all() or np.isinf(reach):
            return ends, nodes.astype(np.int32)[which], metres
        reach = 4 * reach if reach < 100 * spacing else np.inf


def points_around(net: SurfaceNet, reach: float) -> tuple[Int, Int32, Float]:
    """The points within ``reach`` metres along the net of each point, itself first, then the nearest.

    Returns:
        CSR: offsets (C + 1,), points (K,) and metres (K,).
    """
    ends, points, metres = geodesic_kernels.around(*_adjacency(net.graph, len(net.points)), reach)
    return ends, points, metres


def members(net: SurfaceNet) -> tuple[Int, Int32]:
    """CSR: offsets (C + 1,) and the vertices of each point."""
    starts, order = kernels.by_label(net.of_vertex, len(net.points))
    return starts, order


def between_nodes(count: int, edges: Int, lengths: Float, limit: float = np.inf) -> Float:
    """(N, N) the shortest way between nodes over weighted edges; infinite beyond ``limit`` metres."""
    if len(edges) == 0:
        return np.where(np.eye(count, dtype=bool), 0.0, np.inf)
    # csr_matrix would add up edges given twice, so each is given once.
    pairs, shortest = _shortest(edges.astype(np.int64), lengths)
    graph = csr_matrix((np.maximum(shortest, 1e-12), (pairs[:, 0], pairs[:, 1])), (count, count))
    return np.asarray(dijkstra(graph, directed=False, limit=limit))


def _shortest(pairs: Int, lengths: Float) -> tuple[Int, Float]:
    """(B, 2) every pair of two nodes once, smaller number first, and (B,) the shortest of its lengths."""
    different = pairs[:, 0] != pairs[:, 1]
    pairs, lengths = np.sort(pairs[different], 1), lengths[different]
    order = np.lexsort((lengths, pairs[:, 1], pairs[:, 0]))
    pairs, lengths = pairs[order], lengths[order]
    first = np.ones(len(pairs), bool)
    first[1:] = (pairs[1:] != pairs[:-1]).any(1)
    return pairs[first], lengths[first]
