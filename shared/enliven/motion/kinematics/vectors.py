"""Compiled vector operations for the kernels of this package. Vectors are triples (x, y, z), so no memory is
allocated.
"""

from __future__ import annotations

import math

from enliven.kernels import njit


@njit(cache=True, nogil=True)
def subtract(a, b):
    """Returns a - b of triples."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(cache=True, nogil=True)
def cross(a, b):
    """Returns a x b of triples."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, nogil=True)
def dot(a, b):
    """Returns a . b of triples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True)
def length(a):
    """Returns |a| of a triple."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@njit(cache=True, nogil=True)
def row(points, i):
    """Returns row ``i`` of (K, 3) as a triple."""
    return points[i, 0], points[i, 1], points[i, 2]


@njit(cache=True, nogil=True)
def perpendicular_unit(a):
    """Returns a unit vector perpendicular to ``a`` that depends on ``a`` alone."""
    x, y, z = abs(a[0]), abs(a[1]), abs(a[2])
    axis = (1.0, 0.0, 0.0)
    if y <= x and y <= z:
        axis = (0.0, 1.0, 0.0)
    elif z <= x and z <= y:
        axis = (0.0, 0.0, 1.0)
    n = cross(a, axis)
    size = length(n)
    if size == 0.0:
        return 1.0, 0.0, 0.0
    return n[0] / size, n[1] / size, n[2] / size


@njit(cache=True, nogil=True)
def rotation_about(n, angle):
    """Returns the quaternion of a rotation about the unit vector ``n`` by ``angle`` radians."""
    s = math.sin(angle / 2)
    return math.cos(angle / 2), n[0] * s, n[1] * s, n[2] * s


@njit(cache=True, nogil=True)
def swing_to(a, b):
    """Returns the shortest rotation from the direction of ``a`` to the direction of ``b``, or the identity if
    one of them is zero.
    """
    size, other = length(a), length(b)
    if size < 1e-12 or other < 1e-12:
        return 1.0, 0.0, 0.0, 0.0
    n = cross(a, b)
    sine = length(n)
    if sine < 1e-14 * size * other:
        if dot(a, b) > 0.0:
            return 1.0, 0.0, 0.0, 0.0
        n = perpendicular_unit(a)
        return 0.0, n[0], n[1], n[2]
    return rotation_about((n[0] / sine, n[1] / sine, n[2] / sine), math.atan2(sine, dot(a, b)))
