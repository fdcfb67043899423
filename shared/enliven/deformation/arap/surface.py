"""Prepares a mesh for deformation: welds it, joins it to one component, reorders it, and factorizes its
Laplacian."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee

from enliven.arrays import Bool, Float, Int
from enliven.deformation.arap.cells import Cells, build_cells
from enliven.deformation.arap.factor import Factor, factorise
from enliven.deformation.arap.volume import Volume, compute_enclosed_volume
from enliven.deformation.arap.weights import VIRTUAL_EDGE_WEIGHT, find_virtual_edges, surface_edges
from enliven.deformation.graph.connectivity import label_components
from enliven.errors import InputError
from enliven.meshes import Mesh, weld


class PreparedSurface(NamedTuple):
    """A welded, connected, reordered and factorized mesh of V vertices, with P different positions and E
    edges.

    Attributes:
        place_of: (V,) the index of each mesh vertex's position in the solver's order. Welded vertices share a
            position.
        rest: (P, 3) metres relative to ``centre``, the positions at rest in the solver's order.
        centre: (3,) the centre of the mesh's box, so that a mesh far from the origin loses no precision.
        extent: length of the diagonal of the mesh's box in metres.
        loose: (V,) True for vertices that belong to no face.
        edges: (E, 2) pairs of position indices. Virtual edges, which join shells, are last.
        weights: (E,) the weights of the edges, above 0.
        joints: (J, 2) vertices of the mesh that are connected without a face.
        volume: the enclosed volume, or None.
        notes: sentences for the user about repairs.
    """

    place_of: Int
    rest: Float
    centre: Float
    extent: float
    loose: Bool
    edges: Int
    weights: Float
    joints: Int
    cells: Cells
    factor: Factor
    volume: Volume | None
    notes: tuple[str, ...]


def prepare_surface(mesh: Mesh, max_vertices: int, links: Int | None = None) -> PreparedSurface:
    """Returns the prepared surface of any mesh with at least one face.

    Args:
        links: (L, 2) pairs of vertices that are connected without a face. With links, no vertex counts as
            loose.

    Raises:
        InputError: if the mesh has no faces, positions that are not finite, or too many vertices.
    """
    check_mesh(mesh, max_vertices)
    welded, welded_of = weld(mesh)
    points, notes = welded.vertices, []
    if len(points) < len(welded_of):
        notes.append(
            f"{len(welded_of) - len(points)} vertices were joined with another vertex at the same position."
        )
    low, high = points.min(0), points.max(0)
    centre, extent = (low + high) / 2, float(np.linalg.norm(high - low))
    if not extent > 0:
        raise InputError(
            "all vertices are at the same position",
            where=mesh.name,
            remedy="Export the mesh again.",
        )
    is_used = np.zeros(len(points), bool)
    is_used[welded.faces] = True
    extra_links = np.empty((0, 2), np.int64) if links is None else welded_of[links]
    is_used |= links is not None
    if not is_used.all():
        notes.append(f"{(~is_used).sum()} vertices belong to no face, and follow the nearest surface.")
    edges, weights = surface_edges(points, welded.faces)
    edges = np.concatenate([edges, extra_links])
    weights = np.concatenate([weights, np.full(len(extra_links), VIRTUAL_EDGE_WEIGHT)])
    shells = int(label_components(len(points), edges).max()) + 1
    links, link_weights = find_virtual_edges(points, edges)
    if shells > 1:
        notes.append(f"{shells} separate shells were joined by {len(links)} virtual edges.")
    edges, weights = np.concatenate([edges, links]), np.concatenate([weights, link_weights])
    joints = np.unique(welded_of, return_index=True)[1][np.concatenate([extra_links, links])]
    order = _cache_friendly_order(len(points), edges)
    place_of = np.empty(len(points), np.int64)
    place_of[order] = np.arange(len(points))
    edges, rest = place_of[edges], np.ascontiguousarray((points - centre)[order])
    factor = factorise(len(points), edges, weights)
    eliminated = np.empty(len(points), np.int32)
    eliminated[factor.order] = np.arange(len(points))
    cells = build_cells(rest, edges, weights, eliminated)
    volume = compute_enclosed_volume(rest, place_of[welded.faces], cells, factor)
    return PreparedSurface(
        place_of[welded_of],
        rest,
        centre,
        extent,
        ~is_used[welded_of],
        edges,
        weights,
        joints,
        cells,
        factor,
        volume,
        tuple(notes),
    )


def _cache_friendly_order(count: int, edges: Int) -> Int:
    """Returns (P,) an order of the positions in which neighbours are near in memory (reverse
    Cuthill-McKee)."""
    ones = np.ones(len(edges), bool)
    graph = coo_matrix((ones, (edges[:, 0], edges[:, 1])), (count, count)).tocsr()
    return np.asarray(reverse_cuthill_mckee((graph + graph.T).tocsr(), symmetric_mode=True), np.int64)


def check_mesh(mesh: Mesh, max_vertices: int) -> None:
    """Raises an error for a mesh that cannot be deformed.

    Raises:
        InputError: if the mesh has no faces, positions that are not finite, or too many vertices.
    """
    if not len(mesh.faces):
        raise InputError("the mesh has no faces", where=mesh.name, remedy="Use a triangle mesh.")
    if len(mesh.vertices) > max_vertices:
        raise InputError(
            f"the mesh has {len(mesh.vertices):,} vertices, but at most {max_vertices:,} are allowed",
            where=mesh.name,
            remedy="Use a mesh with fewer vertices, or raise the setting most_vertices (slower).",
        )
    wrong_vertices = np.flatnonzero(~np.isfinite(mesh.vertices).all(1))
    if len(wrong_vertices):
        raise InputError(
            f"the position of vertex {wrong_vertices[0]} (and of {len(wrong_vertices) - 1} more) "
            "is not finite",
            where=mesh.name,
        )
