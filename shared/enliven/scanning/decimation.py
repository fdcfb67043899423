"""Decimates the mesh of a scan, and measures its deviation from the original surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from enliven.arrays import Float, Int, Int32
from enliven.meshes import Mesh, extract_submesh

_AGGRESSIVENESS = (3.0, 7.0, 10.0)
"""Aggressiveness of the edge collapse, from 0 to 10. The values are tried in turn until the triangle
budget is met. At 7, three times as many faces fold onto others as at 3."""
_COMPARED_VERTICES = 20_000
"""Number of random scan vertices at which the distance to the new surface is measured."""
_SAMPLE_POINTS = 60_000
"""Number of sample points on a mesh for finding the nearest face: 7 mm apart on a chair."""
_NEAREST_SAMPLES = 20
"""Number of nearest sample points. Only their faces are tested. If an untested face is nearer, the reported
distance is too large."""


@dataclass(frozen=True)
class DecimatedMesh:
    """A mesh with fewer triangles, and its distance from the full mesh.

    Attributes:
        mean: mean distance from the full mesh's vertices to the surface of the decimated mesh, metres.
        distance_99_percentile: 99th percentile of these distances, metres.
    """

    mesh: Mesh
    mean: float
    distance_99_percentile: float


def decimate(mesh: Mesh, faces: int) -> DecimatedMesh:
    """Returns a mesh with at most ``faces`` triangles, by collapsing the edges that move the surface least.

    Vertices take the colour of the nearest vertex of the full mesh. A mesh that is small enough is returned
    unchanged.
    """
    if len(mesh.faces) <= faces:
        return DecimatedMesh(mesh, 0.0, 0.0)
    # Imported here, because a machine that only poses meshes does not need this library.
    from fast_simplification import simplify

    vertices, triangles = mesh.vertices, mesh.faces
    for aggressiveness in _AGGRESSIVENESS:
        if len(triangles) > faces:
            vertices, triangles = simplify(vertices, triangles, target_count=faces, agg=aggressiveness)[:2]
    colours = None
    if mesh.colours is not None:
        colours = mesh.colours[cKDTree(mesh.vertices).query(vertices)[1]]
    reduced = Mesh(np.asarray(vertices, float), _remove_folds(triangles), mesh.name, colours)
    reduced = extract_submesh(reduced, np.ones(len(reduced.faces), bool))
    compared = np.random.default_rng(0).permutation(len(mesh.vertices))[:_COMPARED_VERTICES]
    errors = distance_bounds(reduced, mesh.vertices[compared])
    return DecimatedMesh(reduced, float(errors.mean()), float(np.quantile(errors, 0.99)))


def _remove_folds(faces: Int | Int32) -> Int32:
    """Returns the faces (F, 3) without pairs that share all three corners. Such a pair is a fold of zero
    thickness."""
    _, number, count = np.unique(np.sort(faces, 1), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(faces[count[number.reshape(-1)] == 1], np.int32)


def distance_bounds(mesh: Mesh, points: Float) -> Float:
    """Returns (N,) upper bounds, metres, of the distances from points (N, 3) to the nearest face of a
    mesh.
    """
    corners, areas = mesh.vertices[mesh.faces], np.linalg.norm(mesh.face_vectors(), axis=1)
    # Sample one point on each face, and more on large faces.
    random, count = (
        np.random.default_rng(0),
        np.ceil(_SAMPLE_POINTS * areas / areas.sum()).astype(int).clip(1),
    )
    face = np.repeat(np.arange(len(corners)), count)
    barycentric = random.dirichlet((1.0, 1.0, 1.0), len(face))
    tree = cKDTree((corners[face] * barycentric[..., None]).sum(1))
    candidate_faces = face[tree.query(points, _NEAREST_SAMPLES)[1]]
    squares = [_squared_distances(points, corners[candidate_faces[:, k]]) for k in range(_NEAREST_SAMPLES)]
    return np.asarray(np.sqrt(np.min(squares, axis=0)))


def _squared_distances(points: Float, corners: Float) -> Float:
    """Returns (N,) squared distances of points (N, 3) to triangles (N, 3, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inside, squared_side_distances = np.ones(len(points), bool), np.full(len(points), np.inf)
    for k in range(3):
        start, side = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
        from_start = points - start
        fraction = np.clip((from_start * side).sum(1) / np.maximum((side * side).sum(1), 1e-30), 0.0, 1.0)
        squared_side_distances = np.minimum(
            squared_side_distances, np.square(from_start - fraction[:, None] * side).sum(1)
        )
        inside &= (np.cross(side, from_start) * normal).sum(1) >= 0.0
    area = np.maximum((normal * normal).sum(1), 1e-30)
    squared_heights = np.square(((points - corners[:, 0]) * normal).sum(1)) / area
    return np.asarray(np.where(inside, squared_heights, squared_side_distances))
