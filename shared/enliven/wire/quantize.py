"""Quantises transforms A = Q S to small integers. The rotation Q is stored as a rotation vector, and the
stretch S entry by entry.

The steps are powers of two, so that an integer times its step is exact in floating point:

======== ======================= ==========================================================================
position ``POSITION_STEP`` metres at most step / 2 = 0.12 mm off along each axis
rotation ``ROTATION_STEP`` radians at most sqrt(3) step / 2 = 0.85 mrad off, as an angle
stretch  ``STRETCH_STEP``          at most step / 2 = 0.001 off in each entry of S
======== ======================= ==========================================================================

So the error of a vertex within r metres of its pivot is at most 0.21 mm + r (0.85e-3 |S| + 2.9e-3). For r =
0.2 m this is 1 mm in the worst case, and a tenth of that in practice. The bound for the rotation holds
because the exponential map does not increase distances: |log(exp(a)^-1 exp(b))| <= |a - b|.

The kernels write to preallocated arrays, since they run for every node of every frame.
"""

from __future__ import annotations

import math

from enliven.arrays import Float
from enliven.kernels import njit
from enliven.rotation import nearest_quaternion

POSITION_STEP = 2.0**-12
"""Quantization step of a position, in metres (0.24 mm). The error is at most half of it, far below what a
viewer can show."""
ROTATION_STEP = 2.0**-10
"""Quantization step of a rotation, in radians. A rotation is stored as three such numbers below pi, which are
39 bits before compression."""
STRETCH_STEP = 2.0**-9
"""Quantization step of an entry of S (a ratio). At 0.2 m from a pivot, an error of half a step moves a vertex
by 0.2 mm.
"""
POSITION_ERROR = POSITION_STEP / 2
"""Maximum position error along each axis, in metres."""
ROTATION_ERROR = ROTATION_STEP * math.sqrt(3.0) / 2
"""Maximum rotation error, in radians."""
STRETCH_ERROR = STRETCH_STEP / 2
"""Maximum error of each entry of S."""
MAX_LINEAR_ENTRY = 64.0
"""Maximum absolute value of an entry of a linear part. Larger linear parts are scaled down to it."""


@njit(cache=True, nogil=True)
def rotation_vector(q: Float, out: Float) -> None:
    """Writes the rotation vector (axis times angle, radians) of a unit quaternion to ``out`` (3,). The angle
    is at most pi, and the result is equal for q and -q."""
    sine = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    sign = 1.0 if q[0] >= 0 else -1.0
    scale = 2.0 * sign
    if sine > 1e-12:
        scale = 2.0 * sign * math.atan2(sine, sign * q[0]) / sine
    out[0], out[1], out[2] = scale * q[1], scale * q[2], scale * q[3]


@njit(cache=True, nogil=True)
def rotate_by_vector(a: Float, x: float, y: float, z: float, out: Float) -> None:
    """Writes the unit quaternion a exp(v) with w >= 0 to ``out`` (4,), for the rotation vector v = (x, y,
    z)."""
    angle = math.sqrt(x * x + y * y + z * z)
    scale = 0.5
    if angle > 1e-12:
        scale = math.sin(0.5 * angle) / angle
    w, x, y, z = math.cos(0.5 * angle), scale * x, scale * y, scale * z
    q0 = a[0] * w - a[1] * x - a[2] * y - a[3] * z
    q1 = a[0] * x + a[1] * w + a[2] * z - a[3] * y
    q2 = a[0] * y - a[1] * z + a[2] * w + a[3] * x
    q3 = a[0] * z + a[1] * y - a[2] * x + a[3] * w
    scale = (1.0 if q0 >= 0 else -1.0) / math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    out[0], out[1], out[2], out[3] = scale * q0, scale * q1, scale * q2, scale * q3


@njit(cache=True, nogil=True)
def nearest_rotation(a: Float, room: Float, out: Float) -> None:
    """Computes the rotation Q that maximises trace(Q^T A), and writes its quaternion with w >= 0 to ``out``
    (4,).

    For det A > 0 this is the rotation of A's polar decomposition. Q^T A is symmetric for every A, even if A
    is reflected or singular.

    Args:
        a: (3, 3) finite.
        room: (2, 4, 4) work space.
    """
    if _iterate_polar_newton(a, room[0]):
        _quaternion_of_matrix(room[0], out)
    else:
        w, x, y, z = nearest_quaternion(a)
        sign = 1.0 if w >= 0 else -1.0
        out[0], out[1], out[2], out[3] = sign * w, sign * x, sign * y, sign * z


@njit(cache=True, nogil=True)
def _iterate_polar_newton(a: Float, x: Float) -> bool:
    """Computes the rotation of A's polar decomposition, and writes it to x[:3, :3].

    Returns False if A is reflected or nearly singular.

    The iteration is X <- (X + X^-T) / 2 (Higham, "Computing the polar decomposition", 1986, eq. 3.2).
    """
    size = 0.0
    for r in range(3):
        for c in range(3):
            size += a[r, c] * a[r, c]
    if not 1e-12 < size < 1e12:
        return False
    scale = math.sqrt(3.0 / size)
    for r in range(3):
        for c in range(3):
            x[r, c] = scale * a[r, c]
    for step in range(8):
        c00, c01 = x[1, 1] * x[2, 2] - x[1, 2] * x[2, 1], x[1, 2] * x[2, 0] - x[1, 0] * x[2, 2]
        c02, c10 = x[1, 0] * x[2, 1] - x[1, 1] * x[2, 0], x[0, 2] * x[2, 1] - x[0, 1] * x[2, 2]
        c11, c12 = x[0, 0] * x[2, 2] - x[0, 2] * x[2, 0], x[0, 1] * x[2, 0] - x[0, 0] * x[2, 1]
        c20, c21 = x[0, 1] * x[1, 2] - x[0, 2] * x[1, 1], x[0, 2] * x[1, 0] - x[0, 0] * x[1, 2]
        c22 = x[0, 0] * x[1, 1] - x[0, 1] * x[1, 0]
        det = x[0, 0] * c00 + x[0, 1] * c01 + x[0, 2] * c02
        if det < 0.02:
            return False
        f = 0.5 / det
        x[0, 0], x[0, 1], x[0, 2] = 0.5 * x[0, 0] + f * c00, 0.5 * x[0, 1] + f * c01, 0.5 * x[0, 2] + f * c02
        x[1, 0], x[1, 1], x[1, 2] = 0.5 * x[1, 0] + f * c10, 0.5 * x[1, 1] + f * c11, 0.5 * x[1, 2] + f * c12
        x[2, 0], x[2, 1], x[2, 2] = 0.5 * x[2, 0] + f * c20, 0.5 * x[2, 1] + f * c21, 0.5 * x[2, 2] + f * c22
        # After one iteration no singular value is below 1. Then det - 1 is an upper bound of each singular
        # value's excess above 1 before this iteration. The iteration squares this excess.
        if step > 0 and det - 1.0 < 1e-5:
            return True
    return False


@njit(cache=True, nogil=True)
def _quaternion_of_matrix(m: Float, out: Float) -> None:
    """Writes the quaternion, w >= 0, of a rotation matrix to ``out`` (4,). The method divides by the largest
    component (Shepperd 1978).
    """
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    if trace > max(m[0, 0], m[1, 1], m[2, 2]):
        s = 2.0 * math.sqrt(1.0 + trace)
        w, x, y, z = 0.25 * s, (m[2, 1] - m[1, 2]) / s, (m[0, 2] - m[2, 0]) / s, (m[1, 0] - m[0, 1]) / s
    elif m[0, 0] >= max(m[1, 1], m[2, 2]):
        s = 2.0 * math.sqrt(1.0 + m[0, 0] - m[1, 1] - m[2, 2])
        w, x, y, z = (m[2, 1] - m[1, 2]) / s, 0.25 * s, (m[0, 1] + m[1, 0]) / s, (m[0, 2] + m[2, 0]) / s
    elif m[1, 1] >= m[2, 2]:
        s = 2.0 * math.sqrt(1.0 + m[1, 1] - m[0, 0] - m[2, 2])
        w, x, y, z = (m[0, 2] - m[2, 0]) / s, (m[0, 1] + m[1, 0]) / s, 0.25 * s, (m[1, 2] + m[2, 1]) / s
    else:
        s = 2.0 * math.sqrt(1.0 + m[2, 2] - m[0, 0] - m[1, 1])
        w, x, y, z = (m[1, 0] - m[0, 1]) / s, (m[0, 2] + m[2, 0]) / s, (m[1, 2] + m[2, 1]) / s, 0.25 * s
    scale = (1.0 if w >= 0 else -1.0) / math.sqrt(w * w + x * x + y * y + z * z)
    out[0], out[1], out[2], out[3] = scale * w, scale * x, scale * y, scale * z


@njit(cache=True, nogil=True)
def compute_stretch(a: Float, rotation: Float, out: Float) -> None:
    """Writes the entries 00, 11, 22, 01, 02, 12 of the symmetric part of Q^T A - I to ``out`` (6,)."""
    for c in range(6):
        i, j = (c, c) if c < 3 else (0, c - 2) if c < 5 else (1, 2)
        entry = 0.0
        for m in range(3):
            entry += 0.5 * (rotation[m, i] * a[m, j] + rotation[m, j] * a[m, i])
        out[c] = entry - 1.0 if c < 3 else entry


@njit(cache=True, nogil=True)
def apply_stretch_entries(rotation: Float, s: Float, out: Float) -> None:
    """Writes the product Q S to ``out`` (3, 3). ``s`` are the six entries that :func:`compute_stretch`
    computes."""
    for m in range(3):
        r0, r1, r2 = rotation[m, 0], rotation[m, 1], rotation[m, 2]
        out[m, 0] = r0 * (1 + s[0]) + r1 * s[3] + r2 * s[4]
        out[m, 1] = r0 * s[3] + r1 * (1 + s[1]) + r2 * s[5]
        out[m, 2] = r0 * s[4] + r1 * s[5] + r2 * (1 + s[2])
