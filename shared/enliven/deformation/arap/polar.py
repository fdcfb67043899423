"""Nearest rotations of many 3x3 matrices (polar decomposition), several at a time in vector registers.

trace(RᵀS) is largest for a rotation R with this quaternion: the top eigenvector of Horn's traceless symmetric
4x4 matrix K of S ("Closed-form solution of absolute orientation using unit quaternions", 1987). With |S| = 1,
its characteristic polynomial is x⁴ - 2x² - 8 det(S) x + 1 - 4 |cof S|². Laguerre's method starts at the
square root of 3, which is above every eigenvalue, and descends to the largest eigenvalue. (Newton's method
needs three times the number of steps if the second eigenvalue is near.) The eigenvector is a column of the
adjugate of K - x. The code has no branch and no loop of unknown length, so the compiler vectorizes it. If the
largest eigenvalue is nearly double (cells on a line, inverted cells), a slow but robust method is used.
"""

from __future__ import annotations

import math

import numpy as np

from enliven.kernels import njit
from enliven.rotation import nearest_quaternion, rotation_matrix

N = 64
"""Number of cells in a block. A block is one array. Its row k is ``block[k * N : (k + 1) * N]``."""
S = 0
"""First of the nine rows of a block with the matrices S, column by column."""
R = 9
"""First of the nine rows of a block with the rotations R, column by column."""
TRACE = 18
"""Index of the row of a block with trace(RᵀS), which measures how well R fits S."""
ROOT_DERIVATIVE = 19
"""Row of a block with the derivative of the characteristic polynomial at its largest root. It is 0 if this
eigenvalue is double."""
ROWS = 20
"""Number of rows of a block that this module uses."""
_MAX_UNRELIABLE_DERIVATIVE = 0.05
"""Below this derivative, the adjugate is too small for a reliable eigenvector in float64."""


@njit(cache=True, nogil=True, error_model="numpy")
def _polar_fast(block):  # noqa: PLR0915, a kernel
    """Computes the rows R, TRACE and ROOT_DERIVATIVE of a block from its rows S, by Laguerre's method."""
    for n in range(64):
        a, b, c = block[n], block[n + 3 * 64], block[n + 6 * 64]
        d, e, f = block[n + 64], block[n + 4 * 64], block[n + 7 * 64]
        g, h, i = block[n + 2 * 64], block[n + 5 * 64], block[n + 8 * 64]
        # Normalize the matrix, and compute its cofactors and the coefficients of the polynomial.
        norm = math.sqrt(a * a + b * b + c * c + d * d + e * e + f * f + g * g + h * h + i * i)
        inverse = 1.0 / (norm + 1e-300)
        a, b, c = a * inverse, b * inverse, c * inverse
        d, e, f = d * inverse, e * inverse, f * inverse
        g, h, i = g * inverse, h * inverse, i * inverse
        c00, c01, c02 = e * i - f * h, f * g - d * i, d * h - e * g
        c10, c11, c12 = c * h - b * i, a * i - c * g, b * g - a * h
        c20, c21, c22 = b * f - c * e, c * d - a * f, a * e - b * d
        p1 = -8.0 * (a * c00 + b * c01 + c * c02)
        p0 = c00 * c00 + c01 * c01 + c02 * c02 + c10 * c10 + c11 * c11 + c12 * c12
        p0 = 1.0 - 4.0 * (p0 + c20 * c20 + c21 * c21 + c22 * c22)
        # Find the largest root by Laguerre's method.
        x = 1.7320508075688774
        for _ in range(6):
            square = x * x
            slope = (4.0 * square - 4.0) * x + p1
            value = ((square - 2.0) * x + p1) * x + p0
            root = 9.0 * slope * slope - value * (144.0 * square - 48.0)
            x = x - 4.0 * value / (slope + math.sqrt(root if root > 0.0 else 0.0) + 1e-30)
        slope = (4.0 * x * x - 4.0) * x + p1
        # Build the matrix K - x and its adjugate.
        k00, k11, k22, k33 = a + e + i - x, a - e - i - x, e - a - i - x, i - a - e - x
        k01, k02, k03 = h - f, c - g, d - b
        k12, k13, k23 = b + d, c + g, f + h
        # Compute the upper half of the adjugate from the 2x2 minors of the lower two rows and of the upper
        # two rows.
        m01, m02, m03 = k02 * k13 - k03 * k12, k02 * k23 - k03 * k22, k02 * k33 - k03 * k23
        m12, m13, m23 = k12 * k23 - k13 * k22, k12 * k33 - k13 * k23, k22 * k33 - k23 * k23
        u01, u02, u03 = k00 * k11 - k01 * k01, k00 * k12 - k02 * k01, k00 * k13 - k03 * k01
        u12, u13 = k01 * k12 - k02 * k11, k01 * k13 - k03 * k11
        a00 = k11 * m23 - k12 * m13 + k13 * m12
        a01 = -k01 * m23 + k12 * m03 - k13 * m02
        a02 = k01 * m13 - k11 * m03 + k13 * m01
        a03 = -k01 * m12 + k11 * m02 - k12 * m01
        a11 = k00 * m23 - k02 * m03 + k03 * m02
        a12 = -k00 * m13 + k01 * m03 - k03 * m01
        a13 = k00 * m12 - k01 * m02 + k02 * m01
        a22 = k33 * u01 - k13 * u03 + k03 * u13
        a23 = -k23 * u01 + k13 * u02 - k03 * u12
        a33 = k22 * u01 - k12 * u02 + k02 * u12
        # Choose the adjugate's column with the largest diagonal entry as the quaternion.
        best, q0, q1, q2, q3 = abs(a00), a00, a01, a02, a03
        other = abs(a11)
        q0 = a01 if other > best else q0
        q1 = a11 if other > best else q1
        q2 = a12 if other > best else q2
        q3 = a13 if other > best else q3
        best = other if other > best else best
        other = abs(a22)
        q0 = a02 if other > best else q0
        q1 = a12 if other > best else q1
        q2 = a22 if other > best else q2
        q3 = a23 if other > best else q3
        best = other if other > best else best
        other = abs(a33)
        q0 = a03 if other > best else q0
        q1 = a13 if other > best else q1
        q2 = a23 if other > best else q2
        q3 = a33 if other > best else q3
        # Convert the quaternion into a rotation matrix.
        length = 2.0 / (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3 + 1e-300)
        block[n + 9 * 64] = 1.0 - length * (q2 * q2 + q3 * q3)
        block[n + 10 * 64] = length * (q1 * q2 + q0 * q3)
        block[n + 11 * 64] = length * (q1 * q3 - q0 * q2)
        block[n + 12 * 64] = length * (q1 * q2 - q0 * q3)
        block[n + 13 * 64] = 1.0 - length * (q1 * q1 + q3 * q3)
        block[n + 14 * 64] = length * (q2 * q3 + q0 * q1)
        block[n + 15 * 64] = length * (q1 * q3 + q0 * q2)
        block[n + 16 * 64] = length * (q2 * q3 - q0 * q1)
        block[n + 17 * 64] = 1.0 - length * (q1 * q1 + q2 * q2)
        block[n + 18 * 64] = x * norm
        block[n + 19 * 64] = slope if norm > 1e-200 else 0.0


@njit(cache=True, nogil=True)
def polar(block, count, frames, at):
    """Computes the rows R and TRACE of the first ``count`` cells of a block from its rows S.

    If several rotations are equally good, the one nearest to the last rotation is used. A weak bias towards
    the last rotation, which has no effect in other cases, ensures that trace(RᵀS) never gets smaller.

    Args:
        frames: (16 V,) the solver's state. The first three columns of a cell are its last (scaled) rotation.
        at: the number of the first cell.
    """
    _polar_fast(block)
    for n in range(count):
        if block[ROOT_DERIVATIVE * N + n] > _MAX_UNRELIABLE_DERIVATIVE:
            continue
        m, norm, size = np.empty((3, 3)), 0.0, 0.0
        for k in range(9):
            norm += block[(S + k) * N + n] ** 2
            size += frames[16 * (at + n) + 4 * (k // 3) + k % 3] ** 2
        push = 1e-6 * math.sqrt(norm / size) if size > 0.0 and norm > 0.0 else 1.0
        for k in range(9):
            last = frames[16 * (at + n) + 4 * (k // 3) + k % 3]
            m[k % 3, k // 3] = block[(S + k) * N + n] + push * last
        rotation_matrix(nearest_quaternion(m), m)
        trace = 0.0
        for k in range(9):
            block[(R + k) * N + n] = m[k % 3, k // 3]
            trace += block[(S + k) * N + n] * block[(R + k) * N + n]
        block[TRACE * N + n] = trace
