"""Transformation and ray picking, fast enough for a mesh of a million vertices within one frame.

The kernels are compiled loops. A BLAS product with a 3x3 matrix would start threads that wait for each other.
"""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import AnyArray, Float, Int, Int32
from enliven.kernels import njit

NEAREST = 1e-3
"""Minimum distance in metres in front of the camera for picking."""


def find_first_hit(vertices: Float, faces: Int32, eye: Float, way: Float) -> tuple[int, float]:
    """Returns (index of the nearest face that a ray hits, its distance in metres), after Moeller and Trumbore
    1997. The index is -1 if the ray hits no face.
    """
    face, distance = _first_hit(vertices, faces, np.asarray(eye, np.float64), np.asarray(way, np.float64))
    return int(face), float(distance)


def find_hit_vertex(vertices: Float, face: Int, place: Float) -> int:
    """Returns the vertex index of a face (3,) that is nearest to a position (3,) in metres."""
    return int(face[np.linalg.norm(vertices[face] - place, axis=1).argmin()])


@njit(cache=True, nogil=True)
def moved(points: Float, turn: Float, root: Float, out: AnyArray) -> None:
    """Computes ``out`` (N, 3) = turn (3, 3) points (N, 3) + root (3,)."""
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        for i in range(3):
            out[k, i] = turn[i, 0] * x + turn[i, 1] * y + turn[i, 2] * z + root[i]


@njit(cache=True, nogil=True)
def _first_hit(vertices: Float, faces: Int32, eye: Float, way: Float) -> tuple[int, float]:
    best, nearest = -1, math.inf
    ex, ey, ez = eye[0], eye[1], eye[2]
    wx, wy, wz = way[0], way[1], way[2]
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = vertices[a, 0], vertices[a, 1], vertices[a, 2]
        sx, sy, sz = vertices[b, 0] - ax, vertices[b, 1] - ay, vertices[b, 2] - az
        ox, oy, oz = vertices[c, 0] - ax, vertices[c, 1] - ay, vertices[c, 2] - az
        px, py, pz = wy * oz - wz * oy, wz * ox - wx * oz, wx * oy - wy * ox
        determinant = sx * px + sy * py + sz * pz
        if abs(determinant) < 1e-18:
            continue
        tx, ty, tz = ex - ax, ey - ay, ez - az
        u = (tx * px + ty * py + tz * pz) / determinant
        if u < 0.0 or u > 1.0:
            continue
        qx, qy, qz = ty * sz - tz * sy, tz * sx - tx * sz, tx * sy - ty * sx
        v = (wx * qx + wy * qy + wz * qz) / determinant
        if v < 0.0 or u + v > 1.0:
            continue
        distance = (ox * qx + oy * qy + oz * qz) / determinant
        if NEAREST < distance < nearest:
            best, nearest = f, distance
    return best, nearest
