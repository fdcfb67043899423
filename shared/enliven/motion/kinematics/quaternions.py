"""Compiled quaternion operations for the kernels of this package. Quaternions are tuples (w, x, y, z), so no
memory is allocated.
"""

from __future__ import annotations

import math

from enliven.kernels import njit


@njit(cache=True, nogil=True)
def load(rows, i):
    """Returns row ``i`` of a (N, 4) array as a quaternion."""
    return rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3]


@njit(cache=True, nogil=True)
def store(rows, i, q):
    """Writes row ``i`` of a (N, 4) array."""
    rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3] = q


@njit(cache=True, nogil=True)
def conj(q):
    """Returns the inverse of a unit quaternion."""
    return q[0], -q[1], -q[2], -q[3]


@njit(cache=True, nogil=True)
def mul(a, b):
    """Returns the product a b: rotation ``b`` first, then ``a``."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@njit(cache=True, nogil=True)
def turn(q, x, y, z):
    """Returns the vector (x, y, z) rotated by ``q``."""
    a, b, c = 2 * (q[2] * z - q[3] * y), 2 * (q[3] * x - q[1] * z), 2 * (q[1] * y - q[2] * x)
    return (
        x + q[0] * a + q[2] * c - q[3] * b,
        y + q[0] * b + q[3] * a - q[1] * c,
        z + q[0] * c + q[1] * b - q[2] * a,
    )


@njit(cache=True, nogil=True)
def between(a, b, t):
    """Returns the slerp at ``t`` on the shorter arc from ``a`` to ``b`` (Shoemake 1985), exact at both
    ends.
    """
    cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    if cosine < 0.0:
        cosine, b = -cosine, (-b[0], -b[1], -b[2], -b[3])
    if t == 0.0:
        return a
    if t == 1.0:
        return b
    # e is the part of b that is perpendicular to a. Its length is the sine of the angle, which is also exact
    # for small angles.
    e = (b[0] - cosine * a[0], b[1] - cosine * a[1], b[2] - cosine * a[2], b[3] - cosine * a[3])
    sine = math.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3])
    if sine < 1e-300:
        return a
    angle = t * math.atan2(sine, cosine)
    along, across = math.cos(angle), math.sin(angle) / sine
    return (
        along * a[0] + across * e[0],
        along * a[1] + across * e[1],
        along * a[2] + across * e[2],
        along * a[3] + across * e[3],
    )
