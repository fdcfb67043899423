"""Skin weights by bone heat. They are bounded and smooth, with at most four per vertex, and their sum is one.

    bone_heat(mesh, skeleton) -> SkinWeights                       bones numbered as in the skeleton
    heat_weights(mesh, segments, owners, bones, ...) -> (V, B)     dense, for any segments

Method: I. Baran and J. Popovic, "Automatic rigging and animation of 3D characters", 2007, section 4. The
weights of bone i are the heat equilibrium on the surface, -laplace(w_i) + H w_i = H p_i. Here p_i is one at
the vertices with i as their nearest visible bone, and zero elsewhere. H = c / d^2, with the distance d to
that bone. The cotangent Laplacian omits negative weights, so that the matrix is an M-matrix, and weights are
between 0 and 1. If the equations of all bones are added, a sum of one is the solution. So the weights of all
bones sum to one. A bone that is occluded by other parts of the surface gives a vertex no heat. A part of the
mesh without a visible bone follows the nearest bone.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from enliven.arrays import Bool, Float, Int, Int32
from enliven.document import Skeleton, SkinWeights
from enliven.errors import InputError
from enliven.meshes import Mesh, face_areas, weld
from enliven.modeling.skinning.skin_values import keep_largest_weights
from enliven.modeling.skinning.visibility import find_nearest_seen

_HEAT = 2.0
"""Factor c of the heat H. Lower values give softer transitions around joints."""
_TIE_FRACTION = 1e-3
"""Maximum relative difference in distance to the nearest bone at which another bone also gives heat. So
equally near bones share a vertex.
"""


def bone_heat(mesh: Mesh, skeleton: Skeleton) -> SkinWeights:
    """Computes the four bones that each vertex follows, and their weights.

    Args:
        mesh: at rest, in the skeleton's frame. Any number of shells and duplicate vertices are allowed.

    Raises:
        InputError: if the mesh has no faces.
    """
    segments, owners = bone_segments(skeleton)
    return keep_largest_weights(heat_weights(mesh, segments, owners, len(skeleton)), smooth=True)


def bone_segments(skeleton: Skeleton) -> tuple[Float, Int]:
    """Returns the two ends (S, 2, 3) of each bone in metres, and the number (S,) of each bone. A root without
    bones gives a single point.
    """
    bones = np.arange(1, len(skeleton)) if len(skeleton) > 1 else np.zeros(1, np.int64)
    starts = skeleton.positions[np.maximum(skeleton.parents[bones], 0)]
    return np.stack([starts, skeleton.positions[bones]], 1), bones


def heat_weights(
    mesh: Mesh,
    segments: Float,
    owners: Int,
    bones: int,
    known: Float | None = None,
    free: Bool | None = None,
) -> Float:
    """Computes the weights (V, bones) of all bones.

    Args:
        segments: (S, 2, 3) metres, the ends of each segment. A bone may have several segments.
        owners: (S,) the bone of each segment.
        known: (V, bones) weights of the vertices with ``free`` (V,) False. They do not change, and the other
            weights continue them smoothly.
    """
    if len(mesh.faces) == 0 or not np.isfinite(mesh.vertices).all():
        raise InputError("skin weights need a mesh with faces and finite vertex positions", where=mesh.name)
    welded, of = weld(mesh)
    chosen, distance = find_nearest_seen(
        welded.vertices, compute_outward_normals(welded), welded.faces, segments, _TIE_FRACTION
    )
    laplacian, mass = cotangent_laplacian(welded.vertices, welded.faces)
    _take_nearest_where_hidden(welded, laplacian, segments, chosen, distance)
    extent = float(np.ptp(welded.vertices, axis=0).max()) or 1.0
    # Use a minimum distance, because a vertex on a bone would get infinite heat.
    clamped_distance = np.maximum(distance, 1e-4 * extent)
    heat = np.where(np.isfinite(clamped_distance), _HEAT / clamped_distance**2, 0.0) * mass
    source = np.zeros((len(welded.vertices), bones))
    shares = (chosen >= 0) / np.maximum((chosen >= 0).sum(1), 1)[:, None]
    rows = np.repeat(np.arange(len(source)), chosen.shape[1])
    np.add.at(source, (rows, owners[np.maximum(chosen, 0)].ravel()), shares.ravel())
    matrix = csc_matrix(laplacian + diags(heat))
    if free is None or known is None:
        weights = _solve_weights(matrix, heat[:, None] * source)
    else:
        weights = _continue_weights(matrix, heat[:, None] * source, of, known, free)
    return np.asarray(weights[of])


def cotangent_laplacian(vertices: Float, faces: Int32) -> tuple[csc_matrix, Float]:
    """Computes the cotangent Laplacian and the vertex areas.

    Returns:
        (V, V) the Laplacian without negative weights, with rows that sum to zero; (V,) areas in m^2.
    """
    count = len(vertices)
    area = face_areas(vertices, faces)
    # Raise the angles to at least half a degree, because degenerate faces would have unbounded weights.
    longest = np.zeros(len(faces))
    halves = []
    for k in range(3):
        tip, left, right = (faces[:, (k + m) % 3] for m in range(3))
        u, v = vertices[left] - vertices[tip], vertices[right] - vertices[tip]
        halves.append((left, right, (u * v).sum(1)))
        longest = np.maximum(longest, (u * u).sum(1))
    min_area = np.maximum(area, 0.01 * longest)
    min_area = np.where(min_area > 0, min_area, 1.0)
    rows = np.concatenate([left for left, _, _ in halves] + [right for _, right, _ in halves])
    columns = np.concatenate([right for _, right, _ in halves] + [left for left, _, _ in halves])
    values = np.tile(np.concatenate([dot / min_area for _, _, dot in halves]) / 2, 2)
    laplacian = coo_matrix((values, (rows, columns)), (count, count)).tocsr()
    laplacian.data = np.maximum(laplacian.data, 1e-6)
    degree = np.asarray(laplacian.sum(1)).ravel()
    mass = np.bincount(faces.ravel(), np.repeat(min_area / 6, 3), count)
    return csc_matrix(diags(degree) - laplacian), np.maximum(mass, 1e-12 * float(mass.max() or 1.0))


def compute_outward_normals(welded: Mesh) -> Float:
    """Returns (V, 3) unit normals that point out of the volume, even if the mesh is inside out."""
    a, b, c = (welded.vertices[welded.faces[:, k]] for k in range(3))
    inside_out = np.einsum("ij,ij->", a - welded.vertices.mean(0), np.cross(b - a, c - a)) < 0
    normals = welded.vertex_normals()
    return -normals if inside_out else normals


def _take_nearest_where_hidden(
    welded: Mesh, laplacian: csc_matrix, segments: Float, chosen: Int32, distance: Float
) -> None:
    """Assigns the nearest bone to vertices of connected parts that see no bone, even if this bone is
    occluded."""
    part = connected_components(laplacian, directed=False)[1]
    lit = np.zeros(part.max() + 1, bool)
    lit[part[np.isfinite(distance)]] = True
    for v in np.flatnonzero(~lit[part]):
        starts, vectors = segments[:, 0], segments[:, 1] - segments[:, 0]
        along = ((welded.vertices[v] - starts) * vectors).sum(1)
        u = np.clip(along / np.maximum((vectors**2).sum(1), 1e-300), 0, 1)
        far = np.linalg.norm(starts + u[:, None] * vectors - welded.vertices[v], axis=1)
        chosen[v, 0], distance[v] = np.argmin(far), far.min()


def _solve_weights(matrix: csc_matrix, right: Float) -> Float:
    """Returns the solution (N, B) of ``matrix`` x = ``right`` (N, B). Columns of zeros are skipped."""
    out = np.zeros_like(right)
    warm = np.flatnonzero(right.any(0))
    if len(warm):
        factor = splu(
            matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0
        )
        out[:, warm] = factor.solve(np.ascontiguousarray(right[:, warm]))
    return np.clip(out, 0.0, 1.0)


def _continue_weights(matrix: csc_matrix, right: Float, of: Int, known: Float, free: Bool) -> Float:
    """Returns (W, B) weights. Vertices that are not ``free`` keep the known weights, and the weights of free
    vertices continue them smoothly."""
    loose = np.ones(len(right), bool)
    loose[of[~free]] = False
    weights = np.zeros_like(right)
    weights[of[~free]] = known[~free]
    inner, rim = np.flatnonzero(loose), np.flatnonzero(~loose)
    if len(inner):
        rows = matrix[inner]
        weights[inner] = _solve_weights(
            csc_matrix(rows[:, inner]), right[inner] - rows[:, rim] @ weights[rim]
        )
    return weights
