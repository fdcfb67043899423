"""A coarse surface within a fine one: a Poisson-disk sample of its vertices, and weights for the other
vertices.

Samples are drawn in a fixed random order. Each is at least one spacing along the surface from all earlier
ones. Control points that are not samples yet are added. The Voronoi cell of a sample is the set of vertices
nearest to it along the surface. If three cells meet in a face of the fine mesh, their samples form a coarse
face. If two cells meet elsewhere (around a thin limb), their samples are linked. A shell (connected part)
that is smaller than a few spacings and has no control point gets no samples. It follows the nearest surface.

A fine vertex follows the samples that are near it *along the surface*. So fingers that touch do not stick
together. The weights are from R. Franke and G. Nielson, "Smooth interpolation of large sets of scattered
data", 1980: w_k ~ ((r - d_k) / (r d_k))², with the distance d_k to sample k and the radius r. The blended
motion has no creases, and a sample follows only itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from enliven.arrays import Bool, Float, Float32, Int, Int32
from enliven.deformation.arap.riders import (
    add_tiny_shells,
    coarse_faces,
    find_tiny_shells,
    repeat_rows,
    select_followed_samples,
)
from enliven.deformation.graph.geodesic_kernels import (
    dijkstra_workspace,
    distances_from_sources,
    settle_within,
)
from enliven.errors import InputError
from enliven.kernels import njit
from enliven.meshes import Mesh, shells, space_curve, weld

_ERROR_CONTEXT = "puppet surface"
_SAMPLES_PER_SQUARED_SPACING = 0.45
"""Number of samples that dart throwing produces in an area of one squared spacing."""
_FOLLOW_RADIUS_SPACINGS = 1.5
"""Maximum distance, in spacings, of a sample that a vertex follows. At least one sample is nearer than 1
spacing."""
_MAX_PATH_RATIO = 1.25
"""Paths along edges up to this factor longer than the straight distance count as straight."""
_MAX_SPACING_CORRECTIONS = 6
"""Maximum number of corrections of the spacing. After that, the last samples are used, even if their number
is more than 15 % off."""
_MIN_SPACING_IN_EDGES = 1.5
"""Minimum spacing of samples in mean edge lengths of the mesh. Below it, nearly all vertices would be
samples."""


class CoarseSampling(NamedTuple):
    """The samples of a mesh with V vertices. They do not depend on its control points.

    Attributes:
        whole: the welded mesh with W vertices, ordered so that neighbours are near in memory.
        welded: (V,) the vertex of ``whole`` for each vertex.
        net: the edges of ``whole`` as :func:`edges_around` returns them.
        spacing: metres between samples.
        samples: (B,) vertices of ``whole``.
        riding: (W,) True for vertices of tiny shells, which have no samples and follow the nearest surface.
        start, near, way: the samples near each vertex of ``whole`` (CSR), and their distances along the
            surface in metres.
    """

    whole: Mesh
    welded: Int
    net: tuple[Int, Int32, Float]
    spacing: float
    samples: Int
    riding: Bool
    start: Int
    near: Int32
    way: Float


class CoarseSurface(NamedTuple):
    """M samples of a mesh with V vertices, independent of the order of the control points.

    Attributes:
        mesh: the coarse surface, (M, 3) positions of samples.
        links: (L, 2) pairs of neighbouring samples that share no coarse face.
        held: (P,) the sample of each control point.
        start: (V + 1,) the index in ``near`` at which each vertex's samples begin.
        near: (K,) the samples that each vertex follows.
        weights: (K,) the weights of these samples, above 0; their sum is 1 for each vertex.
        notes: sentences for the user about the sampling.
        base: the samples that do not depend on the control points.
        added: (A,) the samples added for control points, vertices of ``base.whole``.
    """

    mesh: Mesh
    links: Int
    held: Int
    start: Int
    near: Int32
    weights: Float32
    notes: tuple[str, ...]
    base: CoarseSampling
    added: Int


def sample_coarse_surface(
    mesh: Mesh, held: Int, count: int, previous: CoarseSurface | None = None
) -> CoarseSurface:
    """Returns about ``count`` samples of the mesh, including the control points at the vertices ``held``
    (P,).

    Args:
        previous: an earlier result for the same mesh; its samples are reused if possible.

    Raises:
        InputError: if a control point does not exist, or belongs to no face.
    """
    base = _find_samples(mesh, count) if previous is None else previous.base
    _check_held(held, base)
    held_vertices = base.welded[held]
    if base.riding[held_vertices].any():
        base = _find_samples(mesh, count, base.whole.vertices[held_vertices])
        held_vertices = base.welded[held]
    added = np.setdiff1d(held_vertices, base.samples)
    samples = np.concatenate([base.samples, added])
    order = np.argsort(samples)
    held_samples = order[np.searchsorted(samples, held_vertices, sorter=order)]
    if previous is not None and previous.base is base and np.array_equal(previous.added, added):
        return previous._replace(held=held_samples)
    start, near, path_lengths = _add_samples(base, added)
    points, reach = base.whole.vertices, _FOLLOW_RADIUS_SPACINGS * base.spacing
    faces, links = coarse_faces(base.whole.faces, _nearest_samples(start, near, path_lengths))
    start, near, weights = select_followed_samples(
        points, points[samples], start, near, path_lengths, reach, _MAX_PATH_RATIO
    )
    if base.riding.any():
        start, near, weights = add_tiny_shells(base.whole, base.riding, start, near, weights)
    start, near, weights = repeat_rows(base.welded, start, near, weights)
    coarse = Mesh(points[samples], faces, mesh.name)
    notes = _coarsening_notes(base, len(samples))
    return CoarseSurface(coarse, links, held_samples, start, near, weights, notes, base, added)


def _find_samples(mesh: Mesh, count: int, awake: Float | None = None) -> CoarseSampling:
    """Returns about ``count`` samples of the mesh and their neighbourhoods.

    Shells at the positions ``awake`` (A, 3) metres always get samples, even if they are tiny.
    """
    whole, welded = _reorder_along_curve(*weld(mesh))
    net = edges_around(whole.vertices, whole.faces)
    label = shells(whole.faces, len(whole.vertices))
    awake_shells = np.empty(0, np.int64)
    if awake is not None:
        awake_shells = label[scipy.spatial.cKDTree(whole.vertices).query(awake)[1]]
    spacing = float(np.sqrt(whole.area / (_SAMPLES_PER_SQUARED_SPACING * count)))
    min_spacing = _MIN_SPACING_IN_EDGES * float(net[2].mean()) if len(net[2]) else 0.0
    for _ in range(_MAX_SPACING_CORRECTIONS):
        is_riding = find_tiny_shells(whole.vertices, label, awake_shells, spacing)
        order = np.random.default_rng(0).permutation(np.flatnonzero(~is_riding))
        samples = poisson_disk_samples(*net, order, spacing)
        if 0.85 * count <= len(samples) <= 1.15 * count or spacing <= min_spacing:
            break
        spacing = max(spacing * float(np.sqrt(len(samples) / count)), min_spacing)
    neighbourhoods = distances_from_sources(
        *net, samples, len(whole.vertices), _MAX_PATH_RATIO * _FOLLOW_RADIUS_SPACINGS * spacing
    )
    return CoarseSampling(whole, welded, net, spacing, samples, is_riding, *neighbourhoods)


def _reorder_along_curve(mesh: Mesh, welded: Int) -> tuple[Mesh, Int]:
    """Returns the mesh and its welding map (V,), with vertices and faces sorted along a space-filling curve.
    So neighbours are near in memory.
    """
    order = space_curve(mesh.vertices)
    new_index = np.empty(len(order), np.int64)
    new_index[order] = np.arange(len(order))
    faces: Int = new_index[mesh.faces]
    faces = faces[np.argsort(faces.min(1), kind="stable")]
    return Mesh(mesh.vertices[order], faces.astype(np.int32), mesh.name), new_index[welded]


def _add_samples(base: CoarseSampling, added: Int) -> tuple[Int, Int32, Float]:
    """Returns the samples near each vertex (CSR): those of ``base``, then the additional samples ``added``
    (A,), which are numbered after them."""
    if not len(added):
        return base.start, base.near, base.way
    limit = _MAX_PATH_RATIO * _FOLLOW_RADIUS_SPACINGS * base.spacing
    start, near, path_lengths = distances_from_sources(*base.net, added, len(base.whole.vertices), limit)
    sizes = np.diff(base.start), np.diff(start)
    offsets = np.concatenate([[0], np.cumsum(sizes[0] + sizes[1])])
    all_samples, all_lengths = np.empty(offsets[-1], np.int32), np.empty(offsets[-1])
    for row_starts, size, shift, number, lengths in (
        (base.start, sizes[0], 0, base.near, base.way),
        (start, sizes[1], sizes[0], near + len(base.samples), path_lengths),
    ):
        target = np.repeat(offsets[:-1] + shift - row_starts[:-1], size) + np.arange(row_starts[-1])
        all_samples[target], all_lengths[target] = number, lengths
    return offsets, all_samples, all_lengths


def _check_held(held: Int, base: CoarseSampling) -> None:
    count, offsets = len(base.welded), base.net[0]
    for vertex in held.tolist():
        if not 0 <= vertex < count:
            raise InputError(
                f"vertex {vertex} does not exist: the mesh has {count} vertices, numbered from 0",
                where=_ERROR_CONTEXT,
            )
        welded_vertex = base.welded[vertex]
        if offsets[welded_vertex] == offsets[welded_vertex + 1]:
            raise InputError(
                f"vertex {vertex} belongs to no face, so no surface would follow the control point",
                where=_ERROR_CONTEXT,
                remedy="Choose a vertex that belongs to a face.",
            )


def _coarsening_notes(base: CoarseSampling, count: int) -> tuple[str, ...]:
    """Returns sentences for the user about the samples, welds and tiny shells."""
    vertices, points = len(base.welded), len(base.riding)
    notes = [
        (f"The mesh has {vertices:,} vertices. The solver moves {count:,} of them, and the others follow.")
    ]
    if points < vertices:
        notes.append(f"{vertices - points} vertices were joined with another vertex at the same position.")
    if base.riding.any():
        notes.append(f"{int(base.riding.sum())} vertices of tiny separate shells follow the nearest surface.")
    return tuple(notes)


@njit(cache=True, nogil=True)
def edges_around(points, faces):
    """Returns the vertex adjacency in CSR form: offsets (V + 1,), neighbours (E,) and edge lengths (E,) in
    metres.
    """
    count = points.shape[0]
    room = np.zeros(count + 1, np.int64)
    for f in range(faces.shape[0]):
        for c in range(3):
            room[faces[f, c] + 1] += 2
    for v in range(count):
        room[v + 1] += room[v]
    other, fill = np.empty(room[count], np.int32), room[:-1].copy()
    for f in range(faces.shape[0]):
        for c in range(3):
            v = faces[f, c]
            other[fill[v]], other[fill[v] + 1] = faces[f, (c + 1) % 3], faces[f, (c + 2) % 3]
            fill[v] += 2
    offsets, size = np.zeros(count + 1, np.int64), 0
    for v in range(count):
        begin = size
        for e in range(room[v], room[v + 1]):
            u, fresh = other[e], other[e] != v
            for k in range(begin, size):
                if other[k] == u:
                    fresh = False
                    break
            if fresh:
                other[size] = u
                size += 1
        offsets[v + 1] = size
    lengths = np.empty(size)
    for v in range(count):
        for e in range(offsets[v], offsets[v + 1]):
            total = 0.0
            for c in range(3):
                total += (points[v, c] - points[other[e], c]) ** 2
            lengths[e] = np.sqrt(total)
    return offsets, other[:size].copy(), lengths


@njit(cache=True, nogil=True)
def poisson_disk_samples(offsets, neighbours, lengths, order, spacing):
    """Returns (M,) the vertices of ``order`` that are at least ``spacing`` along the surface from all
    earlier ones.
    """
    metres, keys, items, reached = dijkstra_workspace(offsets, neighbours)
    covered = np.zeros(metres.shape[0], np.bool_)
    chosen, size = np.empty(order.shape[0], np.int64), 0
    for v in order:
        if covered[v]:
            continue
        chosen[size] = v
        size += 1
        settled = settle_within(offsets, neighbours, lengths, v, spacing, metres, keys, items, reached)
        for r in range(settled):
            covered[reached[r]] = True
            metres[reached[r]] = np.inf
    return chosen[:size].copy()


@njit(cache=True, nogil=True)
def _nearest_samples(start, near, way):
    """Returns (V,) the sample with the shortest path to each vertex, or -1 if no sample reaches it."""
    out = np.full(start.shape[0] - 1, -1, np.int64)
    for v in range(out.shape[0]):
        best = np.inf
        for k in range(start[v], start[v + 1]):
            if way[k] < best:
                best, out[v] = way[k], near[k]
    return out
