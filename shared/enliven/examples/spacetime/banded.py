"""The spacetime system, solved by a band factor: block LDL' of 3x3 blocks, two beside the diagonal.

The paper's system (eq. 24) has the weights of all frames as unknowns. Within each frame they are eliminated
(``bounded``: c = base - give q), which leaves the accelerations y = lambda A c (eq. 20,
21; A c is c_(i-1) - 2 c_i + c_(i+1)) with q = lambda A' y:

    (1 + lambda^2 A give A') y = lambda A base

It is positive definite whatever the examples are, with eigenvalues of one or more, so it needs no pivoting:
three numbers a frame, and time and memory that grow with the frames and not faster.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.kernels import njit


class Band:
    """The factor of one control point's system.

    Args:
        give: (F, 3, 3) symmetric, not negative.
        weight: lambda.
    """

    def __init__(self, give: Float, weight: float) -> None:
        rows = max(len(give) - 2, 0)
        self._inverse, self._one, self._two = (np.zeros((rows, 3, 3)) for _ in range(3))
        factor(give, weight, self._inverse, self._one, self._two)
        self.work = rows

    def solve(self, right: Float) -> Float:
        """(F - 2, 3, R) the accelerations of right-hand sides of that shape."""
        out = np.ascontiguousarray(right).copy()
        substitute(self._inverse, self._one, self._two, out)
        return out


def accelerations(places: Float) -> Float:
    """(..., F - 2, 3) A c of places (..., F, 3); (..., 0, 3) of fewer than three."""
    return np.asarray(places[..., :-2, :] - 2.0 * places[..., 1:-1, :] + places[..., 2:, :])


def pulled(forces: Float, frames: int) -> Float:
    """(..., F, 3) A' y of forces (..., F - 2, 3)."""
    out = np.zeros((*forces.shape[:-2], frames, 3))
    if frames > 2:
        out[..., :-2, :] += forces
        out[..., 1:-1, :] -= 2.0 * forces
        out[..., 2:, :] += forces
    return out


@njit(cache=True, nogil=True)
def factor(give, weight, inverse, one, two):
    """Kernel: LDL' of 1 + weight^2 A give A'. ``one`` and ``two`` (F - 2, 3, 3) are L's blocks beside the
    diagonal, ``inverse`` (F - 2, 3, 3) that of D."""
    s = weight * weight
    d, middle, after = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for r in range(len(inverse)):
        for i in range(3):
            for j in range(3):
                d[i, j] = s * (give[r, i, j] + 4.0 * give[r + 1, i, j] + give[r + 2, i, j])
            d[i, i] += 1.0
        if r > 1:
            # after: what row r has beside the diagonal two before; two = after D^-1.
            for i in range(3):
                for j in range(3):
                    after[i, j] = s * give[r, i, j]
            _product(after, inverse[r - 2], two[r])
            _take(d, two[r], after)
        if r > 0:
            for i in range(3):
                for j in range(3):
                    middle[i, j] = -2.0 * s * (give[r, i, j] + give[r + 1, i, j])
            if r > 1:
                # Less L(r, r-2) D(r-2) L(r-1, r-2)'; after = L(r, r-2) D(r-2).
                _take(middle, after, one[r - 1])
            _product(middle, inverse[r - 1], one[r])
            _take(d, one[r], middle)
        _inverted(d, inverse[r])


@njit(cache=True, nogil=True)
def substitute(inverse, one, two, out):
    """Kernel: ``out`` (F - 2, 3, R), right-hand sides, becomes the solutions."""
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
def _product(a, b, out):
    """``out`` = a b."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@njit(cache=True, nogil=True, inline="always")
def _take(out, a, b):
    """``out`` -= a b'."""
    for i in range(3):
        for j in range(3):
            out[i, j] -= a[i, 0] * b[j, 0] + a[i, 1] * b[j, 1] + a[i, 2] * b[j, 2]


@njit(cache=True, nogil=True, inline="always")
def _inverted(d, out):
    """``out`` = d^-1 of a symmetric d with eigenvalues of one or more."""
    a, b, c = d[0, 0], 0.5 * (d[0, 1] + d[1, 0]), 0.5 * (d[0, 2] + d[2, 0])
    e, f, g = d[1, 1], 0.5 * (d[1, 2] + d[2, 1]), d[2, 2]
    out[0, 0], out[0, 1], out[0, 2] = e * g - f * f, c * f - b * g, b * f - c * e
    scale = 1.0 / (a * out[0, 0] + b * out[0, 1] + c * out[0, 2])
    out[1, 1], out[1, 2], out[2, 2] = a * g - c * c, b * c - a * f, a * e - b * b
    for i in range(3):
        for j in range(i, 3):
            out[i, j] *= scale
            out[j, i] = out[i, j]
