"""The spacetime system, solved by a band factorization: block LDL' of 3x3 blocks, two off the diagonal.

The unknowns of the paper's system (eq. 24) are the weights of all frames. They are eliminated within each
frame; module ``bounded`` computes the positions c = base - give q for a pull q. This leaves only the
accelerations as unknowns, y = lambda A c (eq. 20, 21), with (A c)_i = c_(i-1) - 2 c_i + c_(i+1) and q =
lambda A' y:

    (1 + lambda^2 A give A') y = lambda A base

The matrix is positive definite for any examples, with eigenvalues of one or more, so it needs no pivoting.
There are three unknowns per frame, and time and memory grow linearly with the number of frames.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.kernels import njit


class Band:
    """The LDL' factorization of one control point's banded system.

    Args:
        compliances: (F, 3, 3) the response (compliance) of the positions to a pull, symmetric and positive
            semidefinite.
        weight: lambda.
    """

    def __init__(self, compliances: Float, weight: float) -> None:
        rows = max(len(compliances) - 2, 0)
        self._inverse, self._one, self._two = (np.zeros((rows, 3, 3)) for _ in range(3))
        factorize_band(compliances, weight, self._inverse, self._one, self._two)
        self.work = rows

    def solve(self, right: Float) -> Float:
        """Solves for the accelerations (F - 2, 3, R) of right-hand sides with that shape."""
        solution = np.ascontiguousarray(right).copy()
        substitute(self._inverse, self._one, self._two, solution)
        return solution


def compute_accelerations(places: Float) -> Float:
    """Computes the accelerations (second differences) A c (..., F - 2, 3) of positions c (..., F, 3). The
    result is empty if there are fewer than three frames.
    """
    return np.asarray(places[..., :-2, :] - 2.0 * places[..., 1:-1, :] + places[..., 2:, :])


def apply_transposed_differences(forces: Float, frames: int) -> Float:
    """Computes A' y (..., F, 3) for forces y (..., F - 2, 3)."""
    pulls = np.zeros((*forces.shape[:-2], frames, 3))
    if frames > 2:
        pulls[..., :-2, :] += forces
        pulls[..., 1:-1, :] -= 2.0 * forces
        pulls[..., 2:, :] += forces
    return pulls


@njit(cache=True, nogil=True)
def factorize_band(give, weight, inverse, one, two):
    """Kernel: factors 1 + weight^2 A give A' as LDL'.

    ``one`` and ``two`` (F - 2, 3, 3) receive L's blocks on the first and second subdiagonal. ``inverse`` (F -
    2, 3, 3) receives the inverse of D.
    """
    s = weight * weight
    d, middle, after = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for r in range(len(inverse)):
        for i in range(3):
            for j in range(3):
                d[i, j] = s * (give[r, i, j] + 4.0 * give[r + 1, i, j] + give[r + 2, i, j])
            d[i, i] += 1.0
        if r > 1:
            # ``after`` becomes the block of row r on the second subdiagonal, and ``two`` becomes after D^-1.
            for i in range(3):
                for j in range(3):
                    after[i, j] = s * give[r, i, j]
            _multiply(after, inverse[r - 2], two[r])
            _subtract_product(d, two[r], after)
        if r > 0:
            for i in range(3):
                for j in range(3):
                    middle[i, j] = -2.0 * s * (give[r, i, j] + give[r + 1, i, j])
            if r > 1:
                # Subtract L(r, r-2) D(r-2) L(r-1, r-2)' from the block. ``after`` holds L(r, r-2) D(r-2).
                _subtract_product(middle, after, one[r - 1])
            _multiply(middle, inverse[r - 1], one[r])
            _subtract_product(d, one[r], middle)
        _invert_symmetric(d, inverse[r])


@njit(cache=True, nogil=True)
def substitute(inverse, one, two, out):
    """Kernel: replaces the right-hand sides ``out`` (F - 2, 3, R) by the solutions."""
    rows, sides = len(inverse), out.shape[2]
    t = np.empty(3)
    for r in range(rows):
        for k in range(sides):
            for i in range(3):
                value = out[r, i, k]
                for j in range(3):
                    if r > 0:
                        value -= one[r, i, j] * out[r - 1, j, k]
                    if r > 1:
                        value -= two[r, i, j] * out[r - 2, j, k]
                out[r, i, k] = value
    for r in range(rows - 1, -1, -1):
        for k in range(sides):
            for i in range(3):
                value = 0.0
                for j in range(3):
                    value += inverse[r, i, j] * out[r, j, k]
                    if r + 1 < rows:
                        value -= one[r + 1, j, i] * out[r + 1, j, k]
                    if r + 2 < rows:
                        value -= two[r + 2, j, i] * out[r + 2, j, k]
                t[i] = value
            for i in range(3):
                out[r, i, k] = t[i]


@njit(cache=True, nogil=True, inline="always")
def _multiply(a, b, out):
    """Computes the matrix product ``out`` = a b."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@njit(cache=True, nogil=True, inline="always")
def _subtract_product(out, a, b):
    """Subtracts a b' from ``out`` in place."""
    for i in range(3):
        for j in range(3):
            out[i, j] -= a[i, 0] * b[j, 0] + a[i, 1] * b[j, 1] + a[i, 2] * b[j, 2]


@njit(cache=True, nogil=True, inline="always")
def _invert_symmetric(d, out):
    """Computes ``out`` = d^-1 for a symmetric matrix d with eigenvalues of one or more."""
    a, b, c = d[0, 0], 0.5 * (d[0, 1] + d[1, 0]), 0.5 * (d[0, 2] + d[2, 0])
    e, f, g = d[1, 1], 0.5 * (d[1, 2] + d[2, 1]), d[2, 2]
    out[0, 0], out[0, 1], out[0, 2] = e * g - f * f, c * f - b * g, b * f - c * e
    scale = 1.0 / (a * out[0, 0] + b * out[0, 1] + c * out[0, 2])
    out[1, 1], out[1, 2], out[2, 2] = a * g - c * c, b * c - a * f, a * e - b * b
    for i in range(3):
        for j in range(i, 3):
            out[i, j] *= scale
            out[j, i] = out[i, j]
