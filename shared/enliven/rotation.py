"""Rotations: unit quaternions (w, x, y, z) over any batch shape, and the rotation nearest to a matrix.

Every function takes and returns float64 arrays and broadcasts over the leading axes. q and -q are the same
rotation. :func:`canonical` returns the quaternion with w >= 0, as in network messages.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.kernels import njit

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
"""(4,) the identity rotation."""
_MIN_STRETCH = 1e-4
"""Minimum stretch of a linear map. Smaller values are invisible, and the logarithm of zero is undefined."""
_ROWS, _COLUMNS = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])
"""(6,) row and column of each of the numbers xx, yy, zz, xy, xz, yz in a symmetric matrix."""
_SYMMETRIC_INDICES = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
"""(3, 3) for each entry of a symmetric matrix, its index in xx, yy, zz, xy, xz, yz."""


def multiply(a: AnyArray, b: AnyArray) -> Float:
    """Returns the product (..., 4), which is the rotation ``b`` followed by ``a``: rotate(multiply(a, b), v)
    == rotate(a, rotate(b, v)).
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        -1,
    )


def conjugate(q: AnyArray) -> Float:
    """Returns the inverse rotation (..., 4) of unit quaternions (..., 4)."""
    return np.asarray(np.asarray(q, np.float64) * np.array([1.0, -1.0, -1.0, -1.0]))


def rotate(q: AnyArray, v: AnyArray) -> Float:
    """Returns the vectors ``v`` (..., 3) rotated by the unit quaternions ``q`` (..., 4)."""
    q, v = np.asarray(q, np.float64), np.asarray(v, np.float64)
    axis = q[..., 1:]
    twice = 2 * _cross(axis, v)
    return np.asarray(v + q[..., :1] * twice + _cross(axis, twice))


def _cross(a: Float, b: Float) -> Float:
    """Returns the cross product a x b (..., 3).

    NumPy's version has an overhead of 50 us, which dominates the time of frames with few nodes.
    """
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0], out[..., 1], out[..., 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return out


def normalized(q: AnyArray) -> Float:
    """Normalises quaternions (..., 4). A quaternion that is zero or not finite becomes the identity."""
    q = np.asarray(q, np.float64)
    finite = np.isfinite(q).all(-1, keepdims=True)
    q = np.where(finite, q, 0.0)
    scale = np.abs(q).max(-1, keepdims=True)
    q = q / np.where(scale > 0, scale, 1.0)
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    return np.asarray(np.where(length > 0, q / np.where(length > 0, length, 1.0), IDENTITY))


def canonical(q: AnyArray) -> Float:
    """Returns the quaternions (..., 4) of the same rotations with w >= 0."""
    q = np.asarray(q, np.float64)
    return np.asarray(np.where(q[..., :1] < 0, -q, q))


def to_matrix(q: AnyArray) -> Float:
    """Converts unit quaternions (..., 4) to rotation matrices (..., 3, 3)."""
    q = np.asarray(q, np.float64)
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    out = np.empty((*q.shape[:-1], 3, 3))
    out[..., 0, 0], out[..., 0, 1] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z)
    out[..., 0, 2], out[..., 1, 0] = 2 * (x * z + w * y), 2 * (x * y + w * z)
    out[..., 1, 1], out[..., 1, 2] = 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    out[..., 2, 0], out[..., 2, 1] = 2 * (x * z - w * y), 2 * (y * z + w * x)
    out[..., 2, 2] = 1 - 2 * (x * x + y * y)
    return out


def from_matrix(matrix: AnyArray) -> Float:
    """Returns the unit quaternions (..., 4), w >= 0, of the proper rotations nearest to matrices (..., 3,
    3)."""
    matrix = np.asarray(matrix, np.float64)
    flat = np.ascontiguousarray(matrix.reshape(-1, 3, 3))
    return canonical(_nearest_quaternions(flat).reshape(*matrix.shape[:-2], 4))


def nearest_rotation(matrix: AnyArray) -> Float:
    """Returns the proper rotation R (..., 3, 3) (det +1) that maximises trace(RᵀM), for any matrix M (..., 3,
    3).

    For det M > 0, R is the rotation of the polar decomposition. R is also a rotation if M is a reflection,
    singular or zero.
    """
    return to_matrix(from_matrix(matrix))


def from_rotation_vector(vector: AnyArray) -> Float:
    """Returns the rotation (..., 4) about ``vector`` (..., 3) by its length in radians."""
    vector = np.asarray(vector, np.float64)
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    # np.sinc has full precision at angle 0, at which sin(angle / 2) / angle would be 0 / 0.
    return np.concatenate([np.cos(angle / 2), vector * np.sinc(angle / (2 * np.pi)) / 2], -1)


def to_rotation_vector(q: AnyArray) -> Float:
    """Converts unit quaternions (..., 4) to rotation vectors (..., 3): axis times angle in [0, pi]
    radians."""
    q = canonical(q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., :1])
    return np.asarray(q[..., 1:] * np.where(sine > 1e-12, angle / np.where(sine > 1e-12, sine, 1.0), 2.0))


def slerp(a: AnyArray, b: AnyArray, t: AnyArray) -> Float:
    """Interpolates rotations on the shorter great arc from ``a`` (t=0) to ``b`` (t=1). Returns (..., 4) at
    ``t`` (...)."""
    step = to_rotation_vector(multiply(conjugate(a), b))
    return multiply(a, from_rotation_vector(step * np.asarray(t, np.float64)[..., None]))


def remove_sign_jumps(turns: AnyArray) -> Float:
    """Returns quaternions (T, N, 4) of the same rotations without sign jumps over time, and with w >= 0 in
    the first frame."""
    flips = np.sign(np.einsum("tnc,tnc->tn", turns[1:], turns[:-1]))
    flips[flips == 0] = 1.0
    start = np.where(turns[:1, :, 0] < 0, -1.0, 1.0)
    signs = np.concatenate([start, start * np.cumprod(flips, 0)])
    return np.asarray(turns * signs[..., None])


def swing(a: AnyArray, b: AnyArray) -> Float:
    """Returns the rotation (..., 4) by the shortest arc from the unit vector ``a`` to ``b``, both (..., 3).

    For opposite vectors it is a half turn about an axis perpendicular to ``a``. All perpendicular axes would
    be equally good. The chosen axis depends only on ``a``.
    """
    a, b = np.broadcast_arrays(np.asarray(a, np.float64), np.asarray(b, np.float64))
    # |a + b| is twice the cosine of half the angle, and |a - b| is twice its sine. Both are exact near 0 and
    # near 180 degrees, whereas the textbook form (1 + a.b, a x b) loses half of its digits.
    cosine = np.linalg.norm(a + b, axis=-1, keepdims=True)
    sine = np.linalg.norm(a - b, axis=-1, keepdims=True)
    cross = np.cross(a, b)
    length = np.linalg.norm(cross, axis=-1, keepdims=True)
    safe = length > 1e-12
    axis = np.where(safe, cross / np.where(safe, length, 1.0), _perpendicular_unit(a))
    return normalized(np.concatenate([cosine, axis * sine], -1))


def unit(vectors: AnyArray) -> Float:
    """Returns the unit vectors (..., N) in the directions of ``vectors`` (..., N). Zero vectors stay zero."""
    vectors = np.asarray(vectors, np.float64)
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1.0))


def _perpendicular_unit(a: Float) -> Float:
    """Returns unit vectors (..., 3) that are perpendicular to the unit vectors ``a`` (..., 3)."""
    smallest = np.abs(a).argmin(-1)
    axis = np.cross(a, np.eye(3)[smallest])
    return np.asarray(axis / np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-300))


@njit(cache=True, nogil=True)
def rotation_matrix(q, out):
    """Writes the matrix of a unit quaternion (four numbers) to ``out`` (3, 3)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    out[0, 0], out[0, 1], out[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    out[1, 0], out[1, 1], out[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    out[2, 0], out[2, 1], out[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@njit(cache=True, nogil=True)
def nearest_rotations(matrices, out):
    """Writes the proper rotations nearest to ``matrices`` (N, 3, 3) to ``out`` (N, 3, 3)."""
    for i in range(matrices.shape[0]):
        rotation_matrix(nearest_quaternion(matrices[i]), out[i])


@njit(cache=True, nogil=True)
def _nearest_quaternions(matrices):
    """Returns the quaternions (N, 4) of the proper rotations nearest to ``matrices`` (N, 3, 3)."""
    out = np.empty((matrices.shape[0], 4))
    for i in range(matrices.shape[0]):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = nearest_quaternion(matrices[i])
    return out


@njit(cache=True, nogil=True)
def nearest_quaternion(m):
    """Returns the quaternion (w, x, y, z) of the proper rotation R with the largest trace(RᵀM), for a
    matrix M (3, 3).

    trace(RᵀM) is the quadratic form qᵀKq of a symmetric, traceless 4x4 K (B. K. P. Horn, "Closed-form
    solution of absolute orientation using unit quaternions", 1987, section 4), so R is K's top eigenvector.
    The cyclic Jacobi method finds it for every input. A double top eigenvalue has several rotations, but
    needs no special case.
    """
    scale = 0.0
    for r in range(3):
        for c in range(3):
            if not np.isfinite(m[r, c]):
                return 1.0, 0.0, 0.0, 0.0
            scale = max(scale, abs(m[r, c]))
    if scale == 0.0:
        return 1.0, 0.0, 0.0, 0.0
    k = np.empty((4, 4))
    a, b, c = m[0, 0] / scale, m[1, 1] / scale, m[2, 2] / scale
    k[0, 0], k[1, 1], k[2, 2], k[3, 3] = a + b + c, a - b - c, b - a - c, c - a - b
    k[0, 1] = (m[2, 1] - m[1, 2]) / scale
    k[0, 2] = (m[0, 2] - m[2, 0]) / scale
    k[0, 3] = (m[1, 0] - m[0, 1]) / scale
    k[1, 2] = (m[0, 1] + m[1, 0]) / scale
    k[1, 3] = (m[0, 2] + m[2, 0]) / scale
    k[2, 3] = (m[1, 2] + m[2, 1]) / scale
    return _largest_eigenvector(k)


@njit(cache=True, nogil=True)
def _largest_eigenvector(k):
    """Returns the unit eigenvector of the largest eigenvalue of the symmetric (4, 4) ``k`` (upper half)."""
    v = np.eye(4)
    for _ in range(16):
        off = 0.0
        for p in range(3):
            for q in range(p + 1, 4):
                off = max(off, abs(k[p, q]))
        if off < 1e-15:
            break
        for p in range(3):
            for q in range(p + 1, 4):
                _jacobi_turn(k, v, p, q)
    top = 0
    for p in range(1, 4):
        if k[p, p] > k[top, top]:
            top = p
    length = np.sqrt(v[0, top] ** 2 + v[1, top] ** 2 + v[2, top] ** 2 + v[3, top] ** 2)
    return v[0, top] / length, v[1, top] / length, v[2, top] / length, v[3, top] / length


@njit(cache=True, nogil=True)
def _jacobi_turn(k, v, p, q):
    """Applies one Jacobi rotation that zeroes k[p, q] (p < q, upper half), and accumulates it in ``v``."""
    if k[p, q] == 0.0:
        return
    theta = (k[q, q] - k[p, p]) / (2 * k[p, q])
    t = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
    if theta < 0:
        t = -t
    c = 1.0 / np.sqrt(t * t + 1.0)
    s = t * c
    k[p, p] -= t * k[p, q]
    k[q, q] += t * k[p, q]
    k[p, q] = 0.0
    for r in range(4):
        if r not in (p, q):
            a, b = min(r, p), max(r, p)
            d, e = min(r, q), max(r, q)
            first, second = k[a, b], k[d, e]
            k[a, b] = c * first - s * second
            k[d, e] = s * first + c * second
        first, second = v[r, p], v[r, q]
        v[r, p] = c * first - s * second
        v[r, q] = s * first + c * second


def hencky_strain(linear: AnyArray, turns: AnyArray) -> Float:
    """Returns the Hencky strain log U (..., 6) of maps (..., 3, 3) with rotations ``turns``: linear = R U.

    The result is a symmetric matrix as (xx, yy, zz, xy, xz, yz). Stretches are at least :data:`_MIN_STRETCH`,
    and reflections are ignored.
    """
    stretch = np.swapaxes(to_matrix(turns), -1, -2) @ np.asarray(linear, np.float64)
    sizes, axes = np.linalg.eigh((stretch + np.swapaxes(stretch, -1, -2)) / 2.0)
    logs = np.log(np.maximum(np.abs(sizes), _MIN_STRETCH))
    return np.asarray(_matrix_from_eigen(logs, axes)[..., _ROWS, _COLUMNS])


def stretch_from_strain(strain: AnyArray) -> Float:
    """Returns the symmetric stretch U = exp(strain) of Hencky strains (..., 6) as matrices (..., 3, 3)."""
    sizes, axes = np.linalg.eigh(make_symmetric_matrix(strain))
    return _matrix_from_eigen(np.exp(sizes), axes)


def make_symmetric_matrix(six: AnyArray) -> Float:
    """Converts numbers (..., 6) xx, yy, zz, xy, xz, yz to symmetric matrices (..., 3, 3)."""
    return np.asarray(six, np.float64)[..., _SYMMETRIC_INDICES]


def rotate_strain(q: AnyArray, strain: AnyArray) -> Float:
    """Rotates strains (..., 6) by ``q`` (..., 4): R strain Rᵀ. Returns (..., 6)."""
    rotation = to_matrix(q)
    rotated = rotation @ make_symmetric_matrix(strain) @ np.swapaxes(rotation, -1, -2)
    return np.asarray(rotated[..., _ROWS, _COLUMNS])


def _matrix_from_eigen(sizes: Float, axes: Float) -> Float:
    return np.asarray((axes * sizes[..., None, :]) @ np.swapaxes(axes, -1, -2))
