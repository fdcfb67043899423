"""Skinning on the processor: the deformation map of KinÊtre, eq. 2, for vertices and normals.

The viewer does the same in its vertex shader; this is for export, tests and collision.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven.arrays import Float32
from enliven.character import Character, Pose


def skin_vertices(character: Character, pose: Pose) -> Float32:
    """(V, 3) float32 world positions: v' = sum_k w_k (linear_k (v - pivot_k) + position_k)."""
    out = np.empty((len(character.vertices), 3), np.float32)
    matrices = np.ascontiguousarray(pose.matrices(character.pivots), np.float32)
    _skin_vertices(character.vertices, character.skin.indices, character.skin.weights, matrices, out)
    return out


def skin_normals(character: Character, pose: Pose, normals: Float32) -> Float32:
    """(V, 3) float32 unit world normals, from ``normals`` (V, 3) at rest.

    A normal follows the inverse transpose of the vertex's blended linear map, taken as its cofactor matrix,
    which needs no division and so survives a singular map.
    """
    out = np.empty((len(character.vertices), 3), np.float32)
    linear = np.ascontiguousarray(pose.linear, np.float32)
    rest = np.ascontiguousarray(normals, np.float32)
    _skin_normals(rest, character.skin.indices, character.skin.weights, linear, out)
    return out


@njit(cache=True, nogil=True, fastmath=True)
def _skin_vertices(vertices, indices, weights, matrices, out):  # type: ignore[no-untyped-def]
    for v in range(vertices.shape[0]):
        x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
        a = b = c = np.float32(0)
        for k in range(4):
            w = weights[v, k]
            m = matrices[indices[v, k]]
            a += w * (m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3])
            b += w * (m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3])
            c += w * (m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3])
        out[v, 0], out[v, 1], out[v, 2] = a, b, c


@njit(cache=True, nogil=True)
def _skin_normals(normals, indices, weights, linear, out):  # type: ignore[no-untyped-def]
    m = np.empty((3, 3), np.float32)
    for v in range(normals.shape[0]):
        m[:] = 0
        for k in range(4):
            w = weights[v, k]
            part = linear[indices[v, k]]
            for r in range(3):
                for c in range(3):
                    m[r, c] += w * part[r, c]
        x, y, z = normals[v, 0], normals[v, 1], normals[v, 2]
        a = (m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1]) * x
        a += (m[1, 2] * m[2, 0] - m[1, 0] * m[2, 2]) * y + (m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0]) * z
        b = (m[0, 2] * m[2, 1] - m[0, 1] * m[2, 2]) * x
        b += (m[0, 0] * m[2, 2] - m[0, 2] * m[2, 0]) * y + (m[0, 1] * m[2, 0] - m[0, 0] * m[2, 1]) * z
        c = (m[0, 1] * m[1, 2] - m[0, 2] * m[1, 1]) * x
        c += (m[0, 2] * m[1, 0] - m[0, 0] * m[1, 2]) * y + (m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]) * z
        length = np.sqrt(a * a + b * b + c * c)
        if length > 0:
            a, b, c = a / length, b / length, c / length
        out[v, 0], out[v, 1], out[v, 2] = a, b, c
