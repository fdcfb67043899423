"""Prepares a mesh for drawing. Vertices are duplicated along creases, so that flat parts look flat and round
parts look round.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Float32, Int, Int32
from enliven.meshes import space_curve
from enliven_viewer.render.surface_kernels import (
    compute_corner_normals,
    find_smoothing_groups,
    first_indices,
    is_closed_mesh,
    number_drawn_vertices,
    number_equal_rows,
    sum_normals,
)


@dataclass(frozen=True)
class DrawnSurface:
    """The vertices and faces as drawn by the GPU.

    Attributes:
        source: (N,) index of the character's vertex that each drawn vertex copies.
        corner: (N,) index of the first of the 3 F face corners that uses each drawn vertex.
        normals: (N, 3) float32 unit normals at rest.
        faces: (F, 3) int32 indices of drawn vertices.
        groups: (F, 3) the smoothing group of each corner.
        angles: (F, 3) corner angles at rest in radians, which weight the faces in their groups' normals.
        group: (N,) the smoothing group of each drawn vertex.
    """

    source: Int
    corner: Int
    normals: Float32
    faces: Int32
    groups: Int
    angles: Float
    group: Int


def split_creases(
    vertices: Float32, faces: Int32, crease: float = math.radians(45), keys: Int32 | None = None
) -> DrawnSurface:
    """Computes smooth normals with breaks where two faces meet at more than ``crease`` radians.

    Two faces share a normal at a vertex if a fan of faces connects them across edges below the crease angle.
    Coincident vertices count as one vertex here, so that a file with unshared vertices is smooth too.

    Args:
        vertices: (V, 3) metres.
        faces: (F, 3).
        keys: (3 F, K) bits per corner. Two corners of a vertex share a drawn vertex only if their bits are
            equal. None means that all bits are equal. Normals are computed per position, so that texture
            seams are not visible in the shading.
    """
    faces = np.array(faces, np.int32)
    kinds = faces if keys is None else number_equal_rows(keys).reshape(-1, 3)
    # Adding 0 maps -0 to 0, so that both have the same bits.
    rounded_vertices = np.ascontiguousarray(vertices, np.float32) + np.float32(0.0)
    place = number_equal_rows(rounded_vertices.view(np.int32))[faces]
    normals, angles = compute_corner_normals(rounded_vertices, faces)
    group, groups = find_smoothing_groups(place, normals, math.cos(crease))
    corner, first = number_drawn_vertices(group, kinds, len(vertices) if keys is None else len(keys))
    drawn_normals = sum_normals(group, groups, normals, angles)[group[first]]
    length = np.linalg.norm(drawn_normals, axis=1, keepdims=True)
    unit = np.where(length > 1e-12, drawn_normals / np.maximum(length, 1e-12), [0.0, 1.0, 0.0])
    return DrawnSurface(
        faces.reshape(-1)[first].astype(np.int64),
        first,
        unit.astype(np.float32),
        corner.reshape(-1, 3),
        group.reshape(-1, 3),
        angles,
        group[first],
    )


def is_closed(vertices: Float32, faces: Int32) -> bool:
    """Returns True if the mesh is closed with its faces outwards, so that back faces are never visible."""
    if not is_closed_mesh(np.array(faces, np.int32), len(vertices)):
        return False
    a, b, c = (vertices[faces[:, k]].astype(np.float64) for k in range(3))
    return bool(np.einsum("ij,ij->", a, np.cross(b, c)) > 0)


def cluster_faces(vertices: Float32, faces: Int32, cell: float) -> Int32:
    """Returns (G, 3) faces of a simplified mesh over the same vertices, by vertex clustering. All vertices in
    a cubic cell of ``cell`` metres are merged.
    """
    key = np.floor(vertices / cell).astype(np.int64)
    key -= key.min(0)
    x, y, z = (int(size) for size in key.max(0) + 1)
    numbers = (key[:, 0] * y + key[:, 1]) * z + key[:, 2] if x * y * z < 2**62 else np.arange(len(key))
    coarse = first_indices(numbers)[faces]
    a, b, c = coarse.T
    is_kept = coarse[(a != b) & (b != c) & (c != a)]
    return np.ascontiguousarray(is_kept if len(is_kept) else faces, dtype=np.int32)


def order_along_morton_curve(vertices: Float32, faces: Int32) -> Int32:
    """Returns the same faces (F, 3), sorted along a Morton curve so that adjacent faces are close in the
    order.

    A GPU caches the last few transformed vertices, so a face that shares a vertex with its predecessor costs
    less. With software OpenGL, the vertex shader ran 3 times per vertex of a scanned mesh in the original
    order, and 1.2 times in this order.
    """
    return np.ascontiguousarray(faces[space_curve(vertices[faces].mean(axis=1, dtype=np.float64))])
