"""Solved vertices for the GPU: positions with smooth normals."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Float32, Int, Int32
from enliven.kernels import njit
from enliven_viewer.render.surface import DrawnSurface


def make_solved_rows(vertices: Float32, faces: Int32, surface: DrawnSurface) -> Float32:
    """Returns (N, 6) float32: position and unit normal of each drawn vertex.

    Faces are weighted by their corner angle in the rest pose. So the rest pose looks like that of a skinned
    mesh, and creases stay in place.

    Args:
        vertices: (V, 3) metres, the character's vertices.
        faces: (F, 3) the character's faces.
        surface: the character's surface as drawn.
    """
    rows = np.empty((len(surface.source), 6), np.float32)
    places = np.ascontiguousarray(vertices, np.float32)
    sums = np.zeros((int(surface.group.max()) + 1, 3))
    _sum_normals(places, faces, surface.groups, surface.angles, sums)
    _rows(places, surface.source, surface.group, surface.normals, sums, rows)
    return rows


@njit(cache=True, nogil=True)
def _sum_normals(vertices: Float32, faces: Int32, groups: Int, angles: Float, sums: Float) -> None:
    """Adds each face's angle-weighted unit normal to the groups of its corners."""
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        x, y, z = vertices[a, 0], vertices[a, 1], vertices[a, 2]
        px, py, pz = float(vertices[b, 0] - x), float(vertices[b, 1] - y), float(vertices[b, 2] - z)
        qx, qy, qz = float(vertices[c, 0] - x), float(vertices[c, 1] - y), float(vertices[c, 2] - z)
        nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
        area = np.sqrt(nx * nx + ny * ny + nz * nz)
        if not area > 1e-14:
            continue
        for k in range(3):
            share, group = angles[f, k] / area, groups[f, k]
            sums[group, 0] += share * nx
            sums[group, 1] += share * ny
            sums[group, 2] += share * nz


@njit(cache=True, nogil=True)
def _rows(vertices: Float32, source: Int, group: Int, rest: Float32, sums: Float, rows: Float32) -> None:
    """Fills the rows. Vertices without face area get their rest normal. Coordinates that are not finite
    become 0.
    """
    for n in range(len(source)):
        for c in range(3):
            value = vertices[source[n], c]
            rows[n, c] = value if np.isfinite(value) else 0.0
        x, y, z = sums[group[n], 0], sums[group[n], 1], sums[group[n], 2]
        length = np.sqrt(x * x + y * y + z * z)
        if length > 1e-12:
            rows[n, 3], rows[n, 4], rows[n, 5] = x / length, y / length, z / length
        else:
            rows[n, 3], rows[n, 4], rows[n, 5] = rest[n, 0], rest[n, 1], rest[n, 2]
