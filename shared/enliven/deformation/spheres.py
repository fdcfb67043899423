"""Sphere proxies: spheres that cover a mesh and move with its graph, for collisions in a physics engine
(KinÊtre, figure 8).

The paper packs the spheres as follows: pick a random vertex, put a sphere of four mean edge lengths around
it, remove the vertices inside, and repeat until no vertex is left. This module differs in four ways. The
radius has limits in metres. It grows until the number of spheres is within the limit. Faces larger than a
sphere are covered too. The centres may lie below the surface, so that thin legs do not become thick.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Int, Int32, UInt16
from enliven.document import Character, Pose
from enliven.errors import InputError
from enliven.kernels import njit
from enliven.meshes import corner_sums, edge_lengths, face_vectors
from enliven.rotation import unit
from enliven.settings import parameter

_RADIUS_GROWTH_FACTOR = 1.12
"""Factor that enlarges the radius in each round while there are too many spheres."""
_COVERED_RADIUS_FACTOR = 1.0 + 1e-9
"""Factor on the radius of a sphere for the test that a point is inside. It tolerates rounding errors."""
_MAX_SAMPLES = 4_000_000
"""Maximum number of samples of large faces. It limits the memory for a mesh with faces far larger than the
spheres."""


@dataclass(frozen=True)
class SphereSettings:
    """Settings for covering a mesh with spheres. Lengths are in metres of the mesh at rest."""

    edges: float = parameter(
        4.0,
        "Sphere radius, as a multiple of the mean edge length of the mesh. The paper uses 4.",
        low=0.1,
        high=1000.0,
    )
    smallest: float = parameter(0.02, "Minimum sphere radius.", unit="m", low=1e-4, high=10.0)
    largest: float = parameter(
        0.10,
        "Maximum sphere radius. A larger radius is used only if the maximum number of spheres "
        "would be exceeded.",
        unit="m",
        low=1e-4,
    )
    most: int = parameter(
        400,
        "Maximum number of spheres per character. If more would be needed, the spheres get larger.",
        low=1,
        high=4096,
    )
    inset: float = parameter(
        0.5,
        "Depth of sphere centres below the surface, as a fraction of the radius. 0 follows "
        "the paper. With larger values, the spheres fit the mesh more tightly.",
        low=0.0,
        high=0.95,
    )


@dataclass(frozen=True)
class SphereProxies:
    """Spheres that cover a character's surface. The transforms of the character move them like its vertices.

    Attributes:
        radius: radius of all spheres at rest, metres.
        rest: (S, 3) float64, the centres at rest, metres.
        indices: (S, 4) uint16, the transforms that each sphere follows.
        weights: (S, 4) float64, the weights of these transforms. Each row sums to one.
        pivots: (J, 3) float64 metres, the character's pivots.
    """

    radius: float
    rest: Float
    indices: UInt16
    weights: Float
    pivots: Float

    def __len__(self) -> int:
        return len(self.rest)

    def centres(self, pose: Pose, out: Float | None = None) -> Float:
        """Returns the centres (S, 3) in a pose, in metres in the world, by eq. 2. Writes them into ``out`` if
        given."""
        if out is None:
            out = np.empty_like(self.rest)
        _move_centres(self.rest, self.indices, self.weights, self.pivots, pose.linear, pose.positions, out)
        return out

    def compute_posed_radius(self, pose: Pose) -> float:
        """Returns the radius of the spheres in a pose, metres. It is scaled by the average growth of the
        pose's linear maps (RMS of their columns).
        """
        return self.radius * float(np.sqrt(np.mean(np.square(pose.linear, dtype=np.float64)) * 3.0))


def pack_spheres(
    character: Character, settings: SphereSettings | None = None, seed: int = 0
) -> SphereProxies:
    """Returns spheres that cover every vertex and every large face of a character. The result is
    deterministic.

    Raises:
        InputError: if a vertex is not finite.
    """
    settings = settings or SphereSettings()
    vertices = np.ascontiguousarray(character.vertices, np.float64)
    faces = np.ascontiguousarray(character.faces, np.int32)
    if not np.isfinite(vertices).all():
        raise InputError(
            "a vertex position of the character is not finite",
            where=f"spheres of {character.id!r}",
            remedy="Export the mesh again.",
        )
    radius = _sphere_radius(vertices, faces, settings)
    rows, shares = surface_samples(vertices, faces, 0.5 * radius)
    at_vertices = unit(corner_sums(faces, face_vectors(vertices, faces), len(vertices)))
    points, normals = (
        _interpolate_values(vertices, rows, shares),
        unit(_interpolate_values(at_vertices, rows, shares)),
    )
    order = np.random.default_rng(seed).permutation(len(points))
    while True:
        inner = points - settings.inset * radius * normals
        sphere_samples = select_greedy_cover(
            points, inner, order, radius * _COVERED_RADIUS_FACTOR, settings.most
        )
        if len(sphere_samples):
            break
        radius *= _RADIUS_GROWTH_FACTOR
    vertex_shares, share = character.skin.indices.astype(np.int64), character.skin.weights.astype(np.float64)
    indices, weights = _find_strongest_nodes(
        vertex_shares, share, rows[sphere_samples], shares[sphere_samples]
    )
    pivots = np.ascontiguousarray(character.pivots, np.float64)
    return SphereProxies(radius, np.ascontiguousarray(inner[sphere_samples]), indices, weights, pivots)


def _sphere_radius(vertices: Float, faces: Int32, settings: SphereSettings) -> float:
    """Returns the radius of the paper, clamped to the settings' limits. The radius is larger if covering the
    area would need too many spheres."""
    mean = float(np.mean(edge_lengths(vertices, faces)))
    area = float(np.linalg.norm(face_vectors(vertices, faces), axis=1).sum()) / 2
    # On a smooth surface, a sphere covers at most about its own area, 4 pi r^2. So with a smaller radius,
    # more than `settings.most` spheres would be needed.
    covering_radius = np.sqrt(area / (4 * np.pi * settings.most))
    return float(
        max(min(max(settings.edges * mean, settings.smallest), settings.largest), covering_radius, 1e-6)
    )


def surface_samples(vertices: Float, faces: Int32, spacing: float) -> tuple[Int, Float]:
    """Returns points that cover the surface: every used vertex, and a grid on each face larger than
    ``spacing`` metres.

    Returns:
        (P, 3) int64 the three vertices around each point, and (P, 3) its barycentric coordinates.
    """
    is_used = np.zeros(len(vertices), bool)
    is_used[faces] = True
    used_vertices = np.flatnonzero(is_used)
    face_corners = np.stack([used_vertices, used_vertices, used_vertices], 1).astype(np.int64)
    unit_shares = np.tile(np.array([1.0, 0.0, 0.0]), (len(used_vertices), 1))
    longest = edge_lengths(vertices, faces).max(1)
    edge_parts = np.ceil(longest / spacing).astype(np.int64)
    large = np.flatnonzero(edge_parts > 1)
    share = min(
        1.0, np.sqrt(_MAX_SAMPLES / max(1.0, float((edge_parts[large].astype(float) ** 2).sum() / 2)))
    )
    rows, shares = [face_corners], [unit_shares]
    for count in np.unique(edge_parts[large]):
        grid = _barycentric_grid(max(2, int(count * share)))
        face_shares = faces[large[edge_parts[large] == count]].astype(np.int64)
        rows.append(np.repeat(face_shares, len(grid), axis=0))
        shares.append(np.tile(grid, (len(face_shares), 1)))
    return np.concatenate(rows), np.concatenate(shares)


def _barycentric_grid(count: int) -> Float:
    """Returns the barycentric coordinates (P, 3) of a grid on a triangle with ``count`` parts along each
    edge. The corners are excluded.
    """
    i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
    inside = i + j <= count
    grid = np.stack([i[inside], j[inside], count - i[inside] - j[inside]], 1)
    return np.asarray(grid[(grid < count).all(1)] / count)


def _interpolate_values(values: Float, rows: Int, weights: Float) -> Float:
    """Returns the values (P, 3) at points inside triangles, interpolated from ``values`` (V, 3) of the
    corners.
    """
    return np.asarray(sum(weights[:, c, None] * values[rows[:, c]] for c in range(3)))


def _find_strongest_nodes(nodes: Int, weights: Float, rows: Int, barycentric: Float) -> tuple[UInt16, Float]:
    """Returns (S, 4) nodes and weights of points between vertices: the four with the largest weights of up to
    twelve."""
    indices = np.zeros((len(rows), 4), np.uint16)
    largest = np.zeros((len(rows), 4))
    for sphere in range(len(rows)):
        total: dict[int, float] = {}
        for corner, share in zip(rows[sphere], barycentric[sphere], strict=True):
            for node, weight in zip(nodes[corner], weights[corner], strict=True):
                total[int(node)] = total.get(int(node), 0.0) + float(share * weight)
        best = sorted(total.items(), key=lambda item: (-item[1], item[0]))[:4]
        for k, (node, weight) in enumerate(best):
            indices[sphere, k], largest[sphere, k] = node, weight
        largest[sphere] /= largest[sphere].sum() or 1.0
    return indices, largest


@njit(cache=True, nogil=True)
def select_greedy_cover(points, inner, order, radius, most):
    """Returns the indices (S,) of the points that get a sphere, or an empty array if ``most`` spheres are too
    few.

    Each sphere covers the points inside it. A hash table finds spheres by grid cells that are as large as
    their radius.
    """
    size = 64
    while size < 4 * most:
        size *= 2
    head = np.full(size, -1, np.int64)
    after = np.empty(most, np.int64)
    chosen = np.empty(most, np.int64)
    count = 0
    for o in range(order.shape[0]):
        p = points[order[o]]
        x, y, z = np.floor(p[0] / radius), np.floor(p[1] / radius), np.floor(p[2] / radius)
        covered = False
        for cell in range(27):
            slot = _hash_slot(x + cell // 9 - 1, y + cell // 3 % 3 - 1, z + cell % 3 - 1, size)
            s = head[slot]
            while s >= 0 and not covered:
                c = inner[chosen[s]]
                d = (p[0] - c[0]) ** 2 + (p[1] - c[1]) ** 2 + (p[2] - c[2]) ** 2
                covered = d <= radius * radius
                s = after[s]
            if covered:
                break
        if covered:
            continue
        if count == most:
            return chosen[:0]
        chosen[count] = order[o]
        c = inner[order[o]]
        slot = _hash_slot(np.floor(c[0] / radius), np.floor(c[1] / radius), np.floor(c[2] / radius), size)
        after[count], head[slot] = head[slot], count
        count += 1
    return chosen[:count]


@njit(cache=True, nogil=True)
def _hash_slot(x, y, z, size):
    """Returns the slot of the grid cell (x, y, z) in a hash table. The ``size`` of the table is a power of
    two."""
    mixed = np.int64(x) * 73856093 ^ np.int64(y) * 19349663 ^ np.int64(z) * 83492791
    return mixed & (size - 1)


@njit(cache=True, nogil=True)
def _move_centres(rest, indices, weights, pivots, linear, positions, out):
    """Computes c' = sum_k w_k (linear_k (c - pivot_k) + position_k) into ``out``."""
    for s in range(rest.shape[0]):
        for a in range(3):
            out[s, a] = 0.0
        for k in range(4):
            w = weights[s, k]
            if w == 0.0:
                continue
            j = indices[s, k]
            x, y, z = rest[s, 0] - pivots[j, 0], rest[s, 1] - pivots[j, 1], rest[s, 2] - pivots[j, 2]
            for a in range(3):
                moved = linear[j, a, 0] * x + linear[j, a, 1] * y + linear[j, a, 2] * z
                out[s, a] += w * (moved + positions[j, a])
