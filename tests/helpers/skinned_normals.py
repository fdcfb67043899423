"""Normals skinned on the CPU in the same way as in the viewer's vertex shader."""

import numpy as np

from enliven.deformation.skinning import check_output
from enliven.kernels import njit


def skin_normals(character, pose, normals, out=None):
    """Returns (V, 3) float32 unit world normals, from ``normals`` (V, 3) at rest.

    A normal is transformed by the inverse transpose of the vertex's blended linear map. It is computed as the
    cofactor matrix, which needs no division and therefore also works for a singular map.

    Args:
        out: (V, 3) float32 to write to.

    Raises:
        InputError: as :func:`skin_vertices`.
    """
    out = check_output(character, pose, out)
    linear = np.ascontiguousarray(pose.linear, np.float32).reshape(-1, 9)
    rest = np.ascontiguousarray(normals, np.float32)
    _skin_normals(rest, character.skin.indices, character.skin.weights, linear, out)
    return out


@njit(cache=True, nogil=True, fastmath=True)
def _skin_normals(normals, indices, weights, m, out):
    """Computes the normals. ``m`` (J, 9) are the linear parts, row by row."""
    for v in range(normals.shape[0]):
        h, i, j, k = indices[v, 0], indices[v, 1], indices[v, 2], indices[v, 3]
        p, q, r, s = weights[v, 0], weights[v, 1], weights[v, 2], weights[v, 3]
        m00 = p * m[h, 0] + q * m[i, 0] + r * m[j, 0] + s * m[k, 0]
        m01 = p * m[h, 1] + q * m[i, 1] + r * m[j, 1] + s * m[k, 1]
        m02 = p * m[h, 2] + q * m[i, 2] + r * m[j, 2] + s * m[k, 2]
        m10 = p * m[h, 3] + q * m[i, 3] + r * m[j, 3] + s * m[k, 3]
        m11 = p * m[h, 4] + q * m[i, 4] + r * m[j, 4] + s * m[k, 4]
        m12 = p * m[h, 5] + q * m[i, 5] + r * m[j, 5] + s * m[k, 5]
        m20 = p * m[h, 6] + q * m[i, 6] + r * m[j, 6] + s * m[k, 6]
        m21 = p * m[h, 7] + q * m[i, 7] + r * m[j, 7] + s * m[k, 7]
        m22 = p * m[h, 8] + q * m[i, 8] + r * m[j, 8] + s * m[k, 8]
        x, y, z = normals[v, 0], normals[v, 1], normals[v, 2]
        a = (m11 * m22 - m12 * m21) * x + (m12 * m20 - m10 * m22) * y + (m10 * m21 - m11 * m20) * z
        b = (m02 * m21 - m01 * m22) * x + (m00 * m22 - m02 * m20) * y + (m01 * m20 - m00 * m21) * z
        c = (m01 * m12 - m02 * m11) * x + (m02 * m10 - m00 * m12) * y + (m00 * m11 - m01 * m10) * z
        squared = a * a + b * b + c * c
        per = np.float32(1) / np.sqrt(squared) if squared > 0 else np.float32(0)
        out[v, 0], out[v, 1], out[v, 2] = a * per, b * per, c * per
