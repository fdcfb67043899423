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
from enliven.deformation.arap.volume import Volume, enclosed_volume
from enliven.deformation.arap.weights import VIRTUAL_EDGE_WEIGHT, surface_edges, virtual_edges
from enliven.deformation.graph import components
from enliven.errors import InputError
from enliven.meshes import Mesh, weld


class PreparedSurface(NamedTuple):
    """A welded, connected, reordered and factorized mesh of V vertices, with P welded vertices (places) and E
    edges.

    Attributes:
        place_of: (V,) the place of each vertex of the mesh in the solver's order; welded ones share it.
        rest: (P, 3) metres relative to ``centre``, the positions at rest in the solver's order.
        centre: (3,) the centre of the mesh's box, so that a mesh far from the origin loses no precision.
        extent: metres, the box's diagonal.
        loose: (V,) True for vertices that belong to no face.
        edges: (E, 2) pairs of places. Virtual edges are last.
        weights: (E,) above 0.
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


def prepare_surface(mesh: Mesh, most_vertices: int, links: Int | None = None) -> PreparedSurface:
    """Returns the prepared surface of any mesh that has a face.

    Args:
        links: (L, 2) vertices that are connected without a face; no vertex is loose then.

    Raises:
        InputError: if there are no faces, positions are not finite, or there are too many vertices.
    """
    check_mesh(mesh, most_vertices)
    welded, of = weld(mesh)
    points, notes = welded.vertices, []
    if len(points) < len(of):
        notes.append(f"{len(of) - len(points)} vertices were welded to others at the same position.")
    low, high = points.min(0), points.max(0)
    centre, extent = (low + high) / 2, float(np.linalg.norm(high - low))
    if not extent > 0:
        raise InputError(
            "all vertices are at one position", where=mesh.name, mend="Export the mesh again, in any unit."
        )
    used = np.zeros(len(points), bool)
    used[welded.faces] = True
    more = np.empty((0, 2), np.int64) if links is None else of[links]
    used |= links is not None
    if not used.all():
        notes.append(f"{(~used).sum()} vertices belong to no face; they follow the nearest surface.")
    edges, weights = surface_edges(points, welded.faces)
    edges = np.concatenate([edges, more])
    weights = np.concatenate([weights, np.full(len(more), VIRTUAL_EDGE_WEIGHT)])
    shells = int(components(len(points), edges).max()) + 1
    links, held = virtual_edges(points, edges)
    if shells > 1:
        notes.append(f"{shells} separate shells were joined by {len(links)} virtual edges.")
    edges, weights = np.concatenate([edges, links]), np.concatenate([weights, held])
    joints = np.unique(of, return_index=True)[1][np.concatenate([more, links])]
    order = _cache_friendly_order(len(points), edges)
    place = np.empty(len(points), np.int64)
    place[order] = np.arange(len(points))
    edges, rest = place[edges], np.ascontiguousarray((points - centre)[order])
    factor = factorise(len(points), edges, weights)
    eliminated = np.empty(len(points), np.int32)
    eliminated[factor.order] = np.arange(len(points))
    cells = build_cells(rest, edges, weights, eliminated)
    volume = enclosed_volume(rest, place[welded.faces], cells, factor)
    return PreparedSurface(
        place[of],
        rest,
        centre,
        extent,
        ~used[of],
        edges,
        weights,
        joints,
        cells,
        factor,
        volume,
        tuple(notes),
    )


def _cache_friendly_order(count: int, edges: Int) -> Int:
    """Returns (P,) an order in which the neighbours of a vertex are near in memory."""
    ones = np.ones(len(edges), bool)
    graph = coo_matrix((ones, (edges[:, 0], edges[:, 1])), (count, count)).tocsr()
    return np.asarray(reverse_cuthill_mckee((graph + graph.T).tocsr(), symmetric_mode=True), np.int64)


def check_mesh(mesh: Mesh, most_vertices: int) -> None:
    """Raises an error for a mesh that cannot be deformed.

    Raises:
        InputError: if there are no faces, positions are not finite, or there are too many vertices.
    """
    if not len(mesh.faces):
        raise InputError("it has no faces", where=mesh.name, mend="Give a triangle mesh.")
    if len(mesh.vertices) > most_vertices:
        raise InputError(
            f"{len(mesh.vertices):,} vertices are too many to drag; at most {most_vertices:,} are allowed",
            where=mesh.name,
            mend="Give a mesh with fewer vertices, or raise most_vertices and wait.",
        )
    broken = np.flatnonzero(~np.isfinite(mesh.vertices).all(1))
    if len(broken):
        raise InputError(
            f"vertex {broken[0]} (and {len(broken) - 1} more) is not at a finite position", where=mesh.name
        )
