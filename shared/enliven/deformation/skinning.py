"""Skinning on the CPU: applies the deformation map of KinÊtre, eq. 2, to vertices.

The viewer computes the same in its vertex shader. This module is used for export, tests and collision. It
uses one thread, because without OpenMP, parallel loops of Numba abort the process if two threads enter them
at the same time.

Three variants were 25 to 50 % slower than the plain loop: blending the four matrices before applying them to
the vertex, rows padded to four floats, and sums over a fixed array.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float32
from enliven.document import Character, Pose
from enliven.errors import InputError
from enliven.kernels import njit


def skin_vertices(character: Character, pose: Pose, out: Float32 | None = None) -> Float32:
    """Returns the vertices (V, 3) float32 of a character in a pose, in metres in the world frame.

    v' = sum_k w_k (linear_k (v - pivot_k) + position_k), over the transforms that the vertex follows.

    Args:
        out: (V, 3) float32 output array, which saves an allocation in every frame.

    Raises:
        InputError: if the pose belongs to another character, or ``out`` has the wrong shape or type.
    """
    out = check_output(character, pose, out)
    matrices = np.ascontiguousarray(pose.matrices(character.pivots), np.float32)
    _skin_vertices(character.vertices, character.skin.indices, character.skin.weights, matrices, out)
    return out


def check_output(character: Character, pose: Pose, out: Float32 | None) -> Float32:
    """Returns the output array (V, 3) after checking its shape and type, because the kernels do not check
    bounds."""
    shape = (len(character.vertices), 3)
    if len(pose.linear) != len(character.pivots):
        raise InputError(
            f"the pose has {len(pose.linear)} transforms, but the character has "
            f"{len(character.pivots)} transforms",
            where=f"character {character.id!r}",
            remedy="Pass a pose of this character.",
        )
    if out is None:
        return np.empty(shape, np.float32)
    if out.shape != shape or out.dtype != np.float32:
        raise InputError(
            f"the output array has the wrong shape {out.shape} or type {out.dtype}",
            where="skinning",
            remedy=f"Pass an array of shape {shape} and type float32.",
        )
    return out


@njit(cache=True, nogil=True, fastmath=True)
def _skin_vertices(vertices, indices, weights, matrices, out):
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
