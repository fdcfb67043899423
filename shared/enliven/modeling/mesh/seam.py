"""Seam repair: smooths the surface around a seam and recomputes the skin weights there, and nowhere else.

    heal_seam(mesh, skin, skeleton, seam) -> (Mesh, SkinWeights)      positions and weights
    smooth_seam(mesh, seam) -> Mesh                                   positions only
    reweight_seam(mesh, skin, skeleton, seam) -> SkinWeights          weights only

``seam`` (V,) is True for the vertices of the seam, such as ``Union.seam`` or ``Piece.kept < 0``. Everything
farther from the seam than the settings allow stays bit-exact. Near the seam, the surface continues the
direction and curvature of its surroundings: a crease becomes a fillet, and smooth parts stay smooth. The
weights near the seam come from :mod:`enliven.modeling.skinning.heat_diffusion`, with the old weights around
them held fixed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.sparse.linalg import spsolve

from enliven.arrays import Bool, Float
from enliven.document import Skeleton, SkinWeights
from enliven.meshes import Mesh, weld
from enliven.meshes.flips import adjacent_triangles
from enliven.modeling.skinning.heat_diffusion import bone_segments, heat_weights
from enliven.modeling.skinning.skin_values import bone_count, keep_largest_weights, make_dense_weights
from enliven.settings import parameter

_SMOOTH_RINGS = 3
"""Number of vertex rings around a seam that are smoothed. A visible step at a seam is about this wide."""
_MIN_SMOOTH_RADII = 0.15
"""Minimum distance from the seam that is smoothed, in radii of the seam, for meshes with narrow rings."""
_MAX_SMOOTH_RADII = 0.9
"""Maximum distance from the seam that is smoothed, in radii of the seam, for meshes with wide rings."""
_MAX_DISPLACEMENT_RADII = 0.3
"""Maximum displacement of a vertex, in radii of the seam, so that a limb keeps its thickness."""
_MIN_SMOOTHED_BEND_DEG = 15.0
"""Minimum bend of a smoothed seam edge, in degrees. Flatter edges are invisible."""
_HOLD_WEIGHT = 1e-6
"""Weight that pulls vertices towards their old positions, relative to the smoothness term."""
_MAX_DISPLACEMENT_EDGES = 1.5
"""Maximum displacement of a vertex by smoothing, in edge lengths."""


@dataclass(frozen=True)
class SeamSettings:
    """Settings for smoothing the surface and the skin weights around a seam."""

    strength: float = parameter(
        1.0, "Strength of the smoothing: 0 is off, 1 is the smoothest shape.", unit="share", low=0.0, high=1.0
    )
    weight_rings: int = parameter(
        3, "Minimum number of vertex rings around a seam that get new skin weights.", low=0, high=40
    )
    weight_reach: float = parameter(
        0.7,
        "Minimum distance from the seam within which skin weights are recomputed.",
        unit="radii of the seam",
        low=0.0,
        high=10.0,
    )


def heal_seam(
    mesh: Mesh, skin: SkinWeights, skeleton: Skeleton, seam: Bool, settings: SeamSettings | None = None
) -> tuple[Mesh, SkinWeights]:
    """Smooths the seam of a mesh and recomputes the skin weights around it.

    Args:
        skeleton: the bones that the skin refers to, in the mesh's frame.
        seam: (V,) True for vertices of the seam.
    """
    smooth = smooth_seam(mesh, seam, settings)
    return smooth, reweight_seam(smooth, skin, skeleton, seam, settings)


def smooth_seam(mesh: Mesh, seam: Bool, settings: SeamSettings | None = None) -> Mesh:
    """Returns the mesh with smoothed rings of vertices around the seam."""
    settings = settings or SeamSettings()
    if settings.strength == 0.0 or not seam.any():
        return mesh
    sharp = find_creases(mesh, seam, _MIN_SMOOTHED_BEND_DEG)
    free = _is_near_seam(mesh, seam, sharp, _SMOOTH_RINGS, _MIN_SMOOTH_RADII, _MAX_SMOOTH_RADII)
    if not free.any() or free.all():
        return mesh
    move = settings.strength * (fair_surface(mesh, free) - mesh.vertices)
    length = np.linalg.norm(move, axis=1, keepdims=True)
    most = _MAX_DISPLACEMENT_RADII * _loop_radius(mesh.vertices[seam])
    moved = mesh.vertices + move * np.minimum(1.0, most / np.maximum(length, 1e-300))
    return replace(mesh, vertices=np.where(free[:, None], moved, mesh.vertices))


def reweight_seam(
    mesh: Mesh, skin: SkinWeights, skeleton: Skeleton, seam: Bool, settings: SeamSettings | None = None
) -> SkinWeights:
    """Returns the skin with the weights of the rings around the seam recomputed by bone heat. The other
    weights stay unchanged."""
    settings = settings or SeamSettings()
    free = _is_near_seam(mesh, seam, seam, settings.weight_rings, settings.weight_reach)
    if not free.any():
        return skin
    bones = max(len(skeleton), bone_count(skin))
    weights = heat_weights(mesh, *bone_segments(skeleton), bones, make_dense_weights(skin, bones), free)
    new = keep_largest_weights(weights[free], smooth=True)
    indices, new_weights = skin.indices.copy(), skin.weights.copy()
    indices[free], new_weights[free] = new.indices, new.weights
    return SkinWeights(indices, new_weights)


def fair_surface(mesh: Mesh, free: Bool) -> Float:
    """Fairs a surface: returns positions (V, 3) that are smooth for vertices with ``free`` (V,) True. The
    other vertices keep their positions.

    The mean curvature and the normals of the surroundings are interpolated harmonically into the free region.
    The free vertices then take the positions that best match the resulting Laplacians, and no vertex moves
    far. A tube continues as a tube, and a plane as a plane. Source: R. Schneider and L. Kobbelt, "Geometric
    fairing of irregular meshes", 2001, in one linear step.
    """
    welded, of = weld(mesh)
    loose = np.zeros(len(welded.vertices), bool)
    loose[of[free]] = True
    neighbour_weights, lengths = _neighbour_shares(welded)
    inner = np.flatnonzero(loose)
    # Only the Laplacians of free vertices and of their neighbours depend on the free positions.
    rows = np.unique(np.concatenate([inner, neighbour_weights[inner].indices]))
    unknown = np.zeros(len(loose), bool)
    unknown[rows] = True
    laplacian = csr_matrix(neighbour_weights - diags(np.ones(neighbour_weights.shape[0])))
    normals = welded.vertex_normals()
    bent = ((laplacian @ welded.vertices) * normals).sum(1) / lengths**2
    carried = _interpolate_unknown(neighbour_weights, np.concatenate([bent[:, None], normals], 1), unknown)
    ahead = carried[:, 1:] / np.maximum(np.linalg.norm(carried[:, 1:], axis=1, keepdims=True), 1e-300)
    wanted = (carried[:, 0] * lengths**2)[:, None] * ahead
    seam_vertices, rest = laplacian[rows][:, inner], laplacian[rows][:, np.flatnonzero(~loose)]
    right = seam_vertices.T @ (wanted[rows] - rest @ welded.vertices[~loose])
    # Pull weakly towards the old positions. This determines small shells that are entirely free, because
    # nothing else fixes their position.
    right = right + _HOLD_WEIGHT * welded.vertices[inner]
    square = (seam_vertices.T @ seam_vertices + _HOLD_WEIGHT * diags(np.ones(len(inner)))).tocsc()
    vertices = welded.vertices.copy()
    move = np.asarray(spsolve(square, right)).reshape(len(inner), 3) - vertices[inner]
    limit = _MAX_DISPLACEMENT_EDGES * np.maximum(lengths[inner], np.median(lengths[inner]))
    most = np.minimum(1.0, limit / np.maximum(np.linalg.norm(move, axis=1), 1e-300))
    vertices[inner] += most[:, None] * move
    return np.asarray(vertices[of])


def _interpolate_unknown(neighbour_weights: csr_matrix, values: Float, unknown: Bool) -> Float:
    """Returns the values (V, K), with unknown values interpolated harmonically from the known values."""
    out = values.copy()
    inner, fixed = np.flatnonzero(unknown), np.flatnonzero(~unknown)
    if len(inner) == 0 or len(fixed) == 0:
        return out
    matrix = diags(np.full(len(inner), 1.0 + 1e-9)) - neighbour_weights[inner][:, inner]
    out[inner] = np.asarray(
        spsolve(matrix.tocsc(), neighbour_weights[inner][:, fixed] @ values[fixed])
    ).reshape(len(inner), -1)
    return out


def _loop_radius(points: Float) -> float:
    """Returns the root-mean-square distance of a loop's points from their centre, in metres."""
    return float(np.sqrt(((points - points.mean(0)) ** 2).sum(1).mean()))


def _neighbour_shares(welded: Mesh) -> tuple[csr_matrix, Float]:
    """Returns normalized neighbour weights and mean neighbour distances.

    Returns:
        (V, V) weights of each vertex's neighbours: nearer neighbours have larger weights, and rows sum to
        one. (V,) the mean distance of the neighbours in metres.
    """
    faces = welded.faces
    starts, ends = faces.ravel(), np.roll(faces, -1, 1).ravel()
    length = np.linalg.norm(welded.vertices[starts] - welded.vertices[ends], axis=1)
    inverse_length = 1.0 / np.maximum(length, 0.2 * float(np.median(length)) + 1e-300)
    rows, columns = np.concatenate([starts, ends]), np.concatenate([ends, starts])
    count = len(welded.vertices)
    neighbour_weights = coo_matrix((np.tile(inverse_length, 2), (rows, columns)), (count, count)).tocsr()
    total = np.asarray(neighbour_weights.sum(1)).ravel()
    neighbour_weights = csr_matrix(diags(1.0 / np.where(total > 0, total, 1.0)) @ neighbour_weights)
    counts = np.bincount(starts, minlength=count)
    # Compute the root mean square with the same weights as the Laplacian.
    square = np.bincount(starts, inverse_length * length**2, count) + np.bincount(
        ends, inverse_length * length**2, count
    )
    return neighbour_weights, np.sqrt(np.where(counts > 0, square / np.where(total > 0, total, 1.0), 1.0))


def find_creases(mesh: Mesh, seam: Bool, degrees: float = 15.0) -> Bool:
    """Returns (V,) true for seam vertices at seam edges with a dihedral bend of more than ``degrees``."""
    welded, of = weld(mesh)
    on = np.zeros(len(welded.vertices), bool)
    on[of[seam]] = True
    faces = welded.faces.astype(np.int64)
    beside = adjacent_triangles(faces, len(on))
    normals = welded.face_normals()
    bends = np.einsum("fa,fka->fk", normals, normals[beside]) < np.cos(np.radians(degrees))
    starts, ends = faces[:, [1, 2, 0]], faces[:, [2, 0, 1]]
    pick = (beside >= 0) & bends & on[starts] & on[ends]
    out = np.zeros(len(on), bool)
    out[starts[pick]], out[ends[pick]] = True, True
    return np.asarray(out[of])


def _is_near_seam(
    mesh: Mesh, seam: Bool, seam_part: Bool, rings: int, reach: float, max_distance: float = np.inf
) -> Bool:
    """Returns (V,) True for vertices around a seam: within a number of edges, or within multiples of its
    radius.

    Duplicate vertices are treated as connected.

    Args:
        seam_part: (V,) the part of the seam to measure from.
        rings: distance in edges.
        reach: distance in radii of the seam within which all vertices count.
        max_distance: distance in radii beyond which no ring counts.
    """
    welded, of = weld(mesh)
    seeds = np.zeros(len(welded.vertices), bool)
    seeds[of[seam_part]] = True
    if not seeds.any():
        return np.asarray(seeds[of])
    ringed = seeds.copy()
    for _ in range(rings):
        ringed[welded.faces[ringed[welded.faces].any(1)]] = True
    away = np.full(len(seeds), np.inf)
    starts, ends = welded.faces.ravel(), np.roll(welded.faces, -1, 1).ravel()
    length = np.linalg.norm(welded.vertices[starts] - welded.vertices[ends], axis=1)
    neighbour_weights = coo_matrix((length, (starts, ends)), (len(seeds), len(seeds))).tocsr()
    seam_vertices = np.unique(of[seam])
    parts = connected_components(neighbour_weights[seam_vertices][:, seam_vertices], directed=False)[1]
    limit = max(reach, max_distance) if np.isfinite(max_distance) else reach
    for part in range(parts.max() + 1):
        members = seam_vertices[parts == part]
        points = welded.vertices[members]
        radius = _loop_radius(points)
        members = members[seeds[members]]
        if radius > 0 and len(members):
            far = dijkstra(
                neighbour_weights, directed=False, indices=members, limit=limit * radius, min_only=True
            )
            away = np.minimum(away, far / radius)
    return np.asarray(
        (seeds | (ringed & ((away <= max_distance) | np.isinf(max_distance))) | (away <= reach))[of]
    )
