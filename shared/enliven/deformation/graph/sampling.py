"""Orientation-aware Poisson-disk sampling of a surface (KinÊtre, "Orientation-Aware Sampling", eq. 6)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from enliven.arrays import Float, Int, Int32
from enliven.errors import InputError
from enliven.kernels import copy_row, njit
from enliven.meshes import Mesh, face_areas, face_vectors, normals_of, weld
from enliven.rotation import unit

_DARTS_PER_NODE = 80
"""Number of candidate points per node. It is large enough to leave almost no gap for another sample."""
_MIN_SMOOTH_COSINE = 0.75
"""Minimum cosine between a vertex normal and its faces' normals for the surface to count as smooth."""
_ROUNDING_TOLERANCE = 1e-9
"""Tolerance for rounding errors, as a fraction of a distance and in metres. Faces within it are tested
too."""
_MIN_SQUARED_DOUBLE_AREA = 1e-30
"""Minimum squared double area of a triangle, square metres squared, to avoid a division by zero."""


class SurfaceSamples(NamedTuple):
    """Sample points on a mesh.

    Attributes:
        positions: (N, 3) metres, the sample points.
        normals: (N, 3) outward unit normals.
        faces: (N,) the face that each point lies on.
        radius: minimum distance D between points, metres; 0 for independent points.
    """

    positions: Float
    normals: Float
    faces: Int32
    radius: float


def sample_uniform_points(
    mesh: Mesh, count: int, rng: np.random.Generator, welded: tuple[Mesh, Int] | None = None
) -> SurfaceSamples:
    """Returns ``count`` independent points, uniform over the area, with interpolated normals.

    If the surface is smooth at a corner of a face, the corner has the welded vertex normal. At a crease, it
    has the face's own normal. So a sphere of few faces is round, and a box keeps its edges.
    """
    along = np.cumsum(face_areas(mesh.vertices, mesh.faces))
    total = float(along[-1]) if len(along) else 0.0
    if not (np.isfinite(total) and total > 0):
        raise InputError(
            "the faces of the mesh have no area", where=mesh.name, remedy="Use a mesh with faces."
        )
    # Sample in equal strata of the area. This gives the same distribution, but leaves fewer holes than
    # independent samples.
    sample_positions = (np.arange(count) + rng.random(count)) / count * total
    faces = np.minimum(np.searchsorted(along, sample_positions), len(along) - 1)
    a, b = rng.random((2, count))
    is_outside = a + b > 1
    a, b = np.where(is_outside, 1 - a, a), np.where(is_outside, 1 - b, b)
    weights = np.stack([1 - a - b, a, b], -1)[..., None]
    return _surface_points(mesh, faces, weights, welded or weld(mesh))


def find_nearest_surface_points(mesh: Mesh, points: Float) -> SurfaceSamples:
    """Returns for each of (N, 3) points in metres the nearest point of the surface, with its normal.

    The result is exact for points on the surface. For other points, the point of each face with clamped
    barycentric coordinates is used.
    """
    corners = mesh.vertices[mesh.faces]
    middles = corners.mean(1)
    reach = float(np.sqrt(np.square(corners - middles[:, None]).sum(2).max(initial=0.0)))
    faces, weights = np.empty(len(points), np.int64), np.empty((len(points), 3))
    _nearest_faces(corners, middles, reach, np.asarray(points, np.float64), faces, weights)
    return _surface_points(mesh, faces, weights[..., None], weld(mesh))


@njit(cache=True, nogil=True)
def _nearest_faces(corners, middles, reach, points, faces, weights):
    """Finds the face (N,) nearest to each point, and its clamped barycentric coordinates (N, 3).

    ``reach`` is the largest distance from a face's centre to its corners, in metres. A face is skipped if its
    centre is farther away than the nearest centre by more than ``reach``.
    """
    far, shares = np.empty(corners.shape[0]), np.empty(3)
    for n in range(points.shape[0]):
        nearest = np.inf
        for f in range(corners.shape[0]):
            far[f] = 0.0
            for i in range(3):
                far[f] += (points[n, i] - middles[f, i]) ** 2
            nearest = min(nearest, far[f])
        most = (np.sqrt(nearest) + reach) * (1.0 + _ROUNDING_TOLERANCE) + _ROUNDING_TOLERANCE
        best = np.inf
        for f in range(corners.shape[0]):
            if far[f] > most * most:
                continue
            off = _clamp_to_triangle(corners[f], points[n], shares)
            if off < best:
                best, faces[n] = off, f
                copy_row(weights[n], shares)


@njit(cache=True, nogil=True)
def _clamp_to_triangle(corners, point, shares):
    """Computes the barycentric coordinates of a point (3,) in a triangle, clamped to the triangle, into
    ``shares`` (3,). Returns the squared distance from the point to the clamped point."""
    uu = uv = vv = along = across = 0.0
    for i in range(3):
        u, v, w = corners[1, i] - corners[0, i], corners[2, i] - corners[0, i], point[i] - corners[0, i]
        uu, uv, vv = uu + u * u, uv + u * v, vv + v * v
        along, across = along + w * u, across + w * v
    area = max(uu * vv - uv * uv, _MIN_SQUARED_DOUBLE_AREA)
    shares[1], shares[2] = (vv * along - uv * across) / area, (uu * across - uv * along) / area
    shares[0] = 1.0 - shares[1] - shares[2]
    total, off = 0.0, 0.0
    for k in range(3):
        shares[k] = max(shares[k], 0.0)
        total += shares[k]
    for i in range(3):
        place = 0.0
        for k in range(3):
            place += shares[k] / total * corners[k, i]
        off += (place - point[i]) ** 2
    for k in range(3):
        shares[k] /= total
    return off


def _surface_points(mesh: Mesh, faces: Int, weights: Float, welded: tuple[Mesh, Int]) -> SurfaceSamples:
    """Returns points on ``faces`` (N,) with given barycentric coordinates (N, 3, 1), and interpolated
    normals.
    """
    positions = (mesh.vertices[mesh.faces[faces]] * weights).sum(1)
    normals = (_corner_normals(mesh, faces, welded) * weights).sum(1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return SurfaceSamples(positions, normals, faces.astype(np.int32), 0.0)


def _corner_normals(mesh: Mesh, faces: Int, welded: tuple[Mesh, Int]) -> Float:
    """Returns (N, 3, 3) unit normals at the corners of ``faces`` (N,)."""
    welded_mesh, welded_of = welded
    corners = welded_of[mesh.faces[faces]]
    corner_vertices, number = np.unique(corners, return_inverse=True)
    normals, min_cosine = normals_of(welded_mesh.vertices, welded_mesh.faces, corner_vertices)
    face_normals = unit(face_vectors(mesh.vertices, mesh.faces[faces]))[:, None]
    number = number.reshape(corners.shape)
    return np.where((min_cosine[number] > _MIN_SMOOTH_COSINE)[..., None], normals[number], face_normals)


def sample_poisson_disk(
    mesh: Mesh,
    nodes: int = 128,
    radius: float | None = None,
    seed: int = 0,
    welded: tuple[Mesh, Int] | None = None,
) -> SurfaceSamples:
    """Returns points with an orientation-aware distance D (eq. 6) of at least R from each other.

    The method is dart throwing in a fixed random order over area-weighted candidates. If ``radius`` is given,
    the number of points follows from it. Otherwise there are exactly ``nodes`` points, and R is found by
    bisection, starting at the paper's sqrt(A / N). (That radius alone gives fewer points on a plane, and more
    on a strongly curved surface.) Any excess points are dropped, the last ones first. ``welded`` is the
    result of :func:`enliven.meshes.mesh.weld` for the mesh, if it is known.

    Raises:
        InputError: if the mesh has no area, ``nodes`` is below 1, or the radius is not positive.
    """
    if nodes < 1 or (radius is not None and not radius > 0):
        raise InputError(
            f"the number of nodes {nodes} or the radius {radius} is not valid",
            where="sampling",
            remedy="Pass at least 1 node and a radius above 0.",
        )
    rng = np.random.default_rng(seed)
    area = mesh.area
    count = nodes if radius is None else max(1, min(int(4 * area / radius**2), 20_000))
    darts = sample_uniform_points(mesh, max(4000, _DARTS_PER_NODE * count), rng, welded)
    order = rng.permutation(len(darts.positions))
    positions, normals = darts.positions[order], darts.normals[order]
    if radius is None:
        radius, accepted = _compute_largest_sample_radius(nodes, positions, normals, np.sqrt(area / nodes))
    else:
        accepted = throw_darts(positions, normals, radius)
    return SurfaceSamples(positions[accepted], normals[accepted], darts.faces[order][accepted], float(radius))


def _compute_largest_sample_radius(
    count: int, positions: Float, normals: Float, radius: float
) -> tuple[float, Int]:
    """Returns the largest radius that gives at least ``count`` points, and the indices (count,) of the first
    of these points."""
    min_radius, max_radius = radius, radius
    accepted = throw_darts(positions, normals, min_radius)
    while len(accepted) < count and min_radius > 1e-9 * radius:
        max_radius, min_radius = min_radius, min_radius / 1.3
        accepted = throw_darts(positions, normals, min_radius)
    while min_radius == max_radius or len(throw_darts(positions, normals, max_radius)) > count:
        min_radius, max_radius = max_radius, max_radius * 1.3
        if max_radius > 1e3 * radius:
            break
    accepted = throw_darts(positions, normals, min_radius)
    for _ in range(24):
        if len(accepted) == count:
            break
        middle = (min_radius + max_radius) / 2
        trial = throw_darts(positions, normals, middle)
        if len(trial) >= count:
            min_radius, accepted = middle, trial
        else:
            max_radius = middle
    return min_radius, accepted[:count]


@njit(cache=True, nogil=True, inline="always")
def orientation_aware_distance(p, n_p, q, n_q):
    """Returns D(p, q) of eq. 6 for points p, q (3,) with unit normals; infinite for normals 90 degrees apart.

    dist_q(p) = |p - q + 2 ((p - q).n_q) n_q| weights the component outside of q's tangent plane three times.
    """
    facing = n_p[0] * n_q[0] + n_p[1] * n_q[1] + n_p[2] * n_q[2]
    if facing <= 1e-9:
        return np.inf
    dx, dy, dz = p[0] - q[0], p[1] - q[1], p[2] - q[2]
    along_p = dx * n_p[0] + dy * n_p[1] + dz * n_p[2]
    along_q = dx * n_q[0] + dy * n_q[1] + dz * n_q[2]
    along = min(abs(along_p), abs(along_q))
    # |d + 2 (d.n) n|^2 = |d|^2 + 8 (d.n)^2, so the smaller (d.n)^2 gives the smaller distance.
    return np.sqrt(dx * dx + dy * dy + dz * dz + 8.0 * along * along) / facing


def throw_darts(positions: Float, normals: Float, radius: float) -> Int:
    """Returns the accepted candidates (K,), in order. Each has a distance D of at least ``radius`` to all
    before it.
    """
    low = positions.min(0)
    # The distance D is never smaller than the Euclidean distance. So with cells of side ``radius``, samples
    # that are too close are in the same cell or in neighbouring cells.
    size = max(radius, float((positions.max(0) - low).max()) / 500)
    cells = ((positions - low) / size).astype(np.int64) + 1
    shape = cells.max(0) + 2
    flat = (cells[:, 0] * shape[1] + cells[:, 1]) * shape[2] + cells[:, 2]
    unique, cell = np.unique(flat, return_inverse=True)
    cell_offsets = np.array([[i, j, k] for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)])
    steps = (cell_offsets[:, 0] * shape[1] + cell_offsets[:, 1]) * shape[2] + cell_offsets[:, 2]
    neighbour_cells = np.searchsorted(unique, unique[:, None] + steps)
    neighbour_cells = np.minimum(neighbour_cells, len(unique) - 1)
    neighbour_cells[unique[neighbour_cells] != unique[:, None] + steps] = -1
    return np.asarray(_throw_darts(positions, normals, cell.reshape(-1), neighbour_cells, radius))


@njit(cache=True, nogil=True)
def _throw_darts(positions, normals, cell, near, radius):
    """Accepts candidates for :func:`throw_darts` (kernel). ``cell`` (M,) is the cell of each candidate, and
    ``near`` (C, 27) are the cells around each cell.
    """
    head = np.full(near.shape[0], -1, np.int64)
    below = np.empty(positions.shape[0], np.int64)
    kept = np.empty(positions.shape[0], np.int64)
    count = 0
    for i in range(positions.shape[0]):
        free = True
        for m in range(27):
            c = near[cell[i], m]
            if c < 0:
                continue
            j = head[c]
            while j >= 0 and free:
                if orientation_aware_distance(positions[i], normals[i], positions[j], normals[j]) < radius:
                    free = False
                j = below[j]
            if not free:
                break
        if free:
            below[i] = head[cell[i]]
            head[cell[i]] = i
            kept[count] = i
            count += 1
    return kept[:count].copy()


def distance_matrix(samples: SurfaceSamples) -> Float:
    """Returns the distances (N, N) between all samples, infinite on the diagonal."""
    return np.asarray(_distance_matrix(samples.positions, samples.normals))


@njit(cache=True, nogil=True)
def _distance_matrix(positions, normals):
    count = positions.shape[0]
    out = np.full((count, count), np.inf)
    for i in range(count):
        for j in range(i):
            out[i, j] = orientation_aware_distance(positions[i], normals[i], positions[j], normals[j])
            out[j, i] = out[i, j]
    return out
