"""Bounded weights: the small quadratic programs of each frame, exactly.

A node is one control point at one frame. With q (3,) the pull on it, its weights w and what it leaves the
examples by, r, are

    argmin  w' M w / 2 - b' w + |r|^2 / (2 slack) + q' (C' w + r + o),      low <= w <= high.

Within the set of weights that are at their bounds, w = still - swing q and c = C' w + r + o = base - give q.
The sets are found by pivoting: all that are wrong at once, and one by one (Murty's least index, which always
ends) where that should go round in circles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from enliven.arrays import AnyArray, Float

_AT_ONCE = 6
"""Rounds of changing all that is wrong at once before it is done one by one."""


@dataclass
class Nodes:
    """Points times frames (P, F), E weights each; ``respond`` fills the lower ones."""

    matrix: Float  # (P, F, E, E)
    right: Float  # (P, F, E)
    reach: Float  # (P, F, E, 3)
    offset: Float  # (P, F, 3)
    slack: Float  # (P, F, 3), zero along an axis that is held
    state: AnyArray  # (P, F, E) int8: -1 at its low bound, 0 free, 1 at its high bound
    still: Float  # (P, F, E)
    swing: Float  # (P, F, E, 3)
    base: Float  # (P, F, 3)
    give: Float  # (P, F, 3, 3)

    @staticmethod
    def of(matrix: Float, right: Float, reach: Float, slack: float) -> Nodes:
        """Nodes that nothing holds."""
        points, frames = right.shape[:2]
        shape = (points, frames, 3)
        state = np.full(right.shape, 2, np.int8)
        still, swing = np.zeros_like(right), np.zeros_like(reach)
        give, wide = np.zeros((*shape, 3)), np.full(shape, slack)
        return Nodes(matrix, right, reach, np.zeros(shape), wide, state, still, swing, np.zeros(shape), give)

    def respond(self, pull: Float, low: float, high: float, places: Float) -> tuple[int, float]:
        """Answers a pull (P, F, 3) with ``places`` (P, F, 3).

        Returns:
            How many nodes changed the weights that are at bounds, and the sum of the least energies.
        """
        lower = (self.matrix, self.right, self.reach, self.offset, self.slack, self.state)
        return respond(*lower, self.still, self.swing, self.base, self.give, pull, low, high, places)  # type: ignore[no-any-return]

    def of_points(self, points: list[int]) -> Nodes:
        """Some of the points; a range of them shares the arrays."""
        rows = (
            slice(points[0], points[-1] + 1) if points == list(range(points[0], points[-1] + 1)) else points
        )
        return Nodes(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


@njit(cache=True, nogil=True)
def respond(  # type: ignore[no-untyped-def]
    matrix, right, reach, offset, slack, state, still, swing, base, give, pull, low, high, places
):
    """Kernel: see :meth:`Nodes.respond`."""
    points, frames, most = right.shape
    changed, energy = 0, 0.0
    w, g, free = np.empty(most), np.empty(most), np.empty(most, np.int64)
    factor, trial = np.empty((most, most)), np.empty(most, np.int8)
    for p in range(points):
        for f in range(frames):
            if state[p, f, 0] == 2:
                state[p, f, :] = 0
                fits = False
                first = True
            else:
                first = False
                _weights(still[p, f], swing[p, f], pull[p, f], w)
                fits = (
                    _wrong(matrix[p, f], right[p, f], reach[p, f], pull[p, f], state[p, f], w, low, high) < 0
                )
            if not fits:
                trial[:] = state[p, f]
                _pivot(
                    matrix[p, f], right[p, f], reach[p, f], pull[p, f], trial, w, g, free, factor, low, high
                )
                different = first
                for e in range(most):
                    different |= trial[e] != state[p, f, e]
                    state[p, f, e] = trial[e]
                if different:
                    changed += 1
                    args = (matrix[p, f], right[p, f], reach[p, f], state[p, f], low, high, free, factor)
                    _answer(args, still[p, f], swing[p, f])
                    _give(
                        offset[p, f],
                        slack[p, f],
                        reach[p, f],
                        still[p, f],
                        swing[p, f],
                        base[p, f],
                        give[p, f],
                    )
                _weights(still[p, f], swing[p, f], pull[p, f], w)
            energy += _energy(matrix[p, f], right[p, f], w)
            for i in range(3):
                q = pull[p, f, i]
                c = offset[p, f, i] - slack[p, f, i] * q
                for e in range(most):
                    c += reach[p, f, e, i] * w[e]
                places[p, f, i] = c
                energy += q * c + 0.5 * slack[p, f, i] * q * q
    return changed, energy


@njit(cache=True, nogil=True)
def _weights(still, swing, pull, w):  # type: ignore[no-untyped-def]
    for e in range(len(w)):
        w[e] = still[e] - swing[e, 0] * pull[0] - swing[e, 1] * pull[1] - swing[e, 2] * pull[2]


@njit(cache=True, nogil=True)
def _energy(matrix, right, w):  # type: ignore[no-untyped-def]
    total = 0.0
    for a in range(len(w)):
        row = 0.5 * matrix[a, a] * w[a]
        for b in range(a):
            row += matrix[a, b] * w[b]
        total += w[a] * (row - right[a])
    return total


@njit(cache=True, nogil=True)
def _wrong(matrix, right, reach, pull, state, w, low, high):  # type: ignore[no-untyped-def]
    """The first weight that is out of bounds, or at one that it wants to leave; -1 for none."""
    for e in range(len(w)):
        if _is_wrong(matrix, right, reach, pull, state, w, low, high, e):
            return e
    return -1


@njit(cache=True, nogil=True)
def _is_wrong(matrix, right, reach, pull, state, w, low, high, e):  # type: ignore[no-untyped-def]
    if state[e] == 0:
        return w[e] < low - 1e-12 or w[e] > high + 1e-12
    slope = reach[e, 0] * pull[0] + reach[e, 1] * pull[1] + reach[e, 2] * pull[2] - right[e]
    scale = abs(right[e])
    for b in range(len(w)):
        slope += matrix[e, b] * w[b]
    return -state[e] * slope < -1e-12 * scale


@njit(cache=True, nogil=True)
def _pivot(matrix, right, reach, pull, state, w, g, free, factor, low, high):  # type: ignore[no-untyped-def]
    """Finds ``state`` and ``w`` of a pull, starting at ``state``."""
    most = len(w)
    for e in range(most):
        g[e] = right[e] - reach[e, 0] * pull[0] - reach[e, 1] * pull[1] - reach[e, 2] * pull[2]
    for turn in range(_AT_ONCE + 50 * 2 ** min(most, 12)):
        count = _factor(matrix, state, free, factor)
        _fill(matrix, g, state, low, high, free, factor, count, w)
        first = _wrong(matrix, right, reach, pull, state, w, low, high)
        if first < 0:
            return
        last = most if turn < _AT_ONCE else first + 1
        # All are judged by the same weights: the states change only afterwards.
        for e in range(first, last):
            if _is_wrong(matrix, right, reach, pull, state, w, low, high, e):
                state[e] = _other(state[e], w[e], low)


@njit(cache=True, nogil=True)
def _other(state, w, low):  # type: ignore[no-untyped-def]
    if state != 0:
        return 0
    return -1 if w < low else 1


@njit(cache=True, nogil=True)
def _factor(matrix, state, free, factor):  # type: ignore[no-untyped-def]
    """Cholesky of the free weights' part; returns how many are free."""
    count = 0
    for e in range(len(state)):
        if state[e] == 0:
            free[count] = e
            count += 1
    for a in range(count):
        for b in range(a + 1):
            value = matrix[free[a], free[b]]
            for k in range(b):
                value -= factor[a, k] * factor[b, k]
            factor[a, b] = np.sqrt(max(value, 1e-14)) if a == b else value / factor[b, b]
    return count


@njit(cache=True, nogil=True)
def _fill(matrix, g, state, low, high, free, factor, count, w):  # type: ignore[no-untyped-def]
    """``w`` with those at bounds at their bounds, and the free ones of right-hand side ``g``."""
    for e in range(len(w)):
        if state[e] != 0:
            w[e] = low if state[e] < 0 else high
    for a in range(count):
        value = g[free[a]]
        for e in range(len(w)):
            if state[e] != 0:
                value -= matrix[free[a], e] * w[e]
        for k in range(a):
            value -= factor[a, k] * w[free[k]]
        w[free[a]] = value / factor[a, a]
    for a in range(count - 1, -1, -1):
        value = w[free[a]]
        for k in range(a + 1, count):
            value -= factor[k, a] * w[free[k]]
        w[free[a]] = value / factor[a, a]


@njit(cache=True, nogil=True)
def _answer(args, still, swing):  # type: ignore[no-untyped-def]
    """``still`` (E,) and ``swing`` (E, 3) of a node whose states are known."""
    matrix, right, reach, state, low, high, free, factor = args
    count = _factor(matrix, state, free, factor)
    _fill(matrix, right, state, low, high, free, factor, count, still)
    swing[:] = 0.0
    for i in range(3):
        for a in range(count):
            value = reach[free[a], i]
            for k in range(a):
                value -= factor[a, k] * swing[free[k], i]
            swing[free[a], i] = value / factor[a, a]
        for a in range(count - 1, -1, -1):
            value = swing[free[a], i]
            for k in range(a + 1, count):
                value -= factor[k, a] * swing[free[k], i]
            swing[free[a], i] = value / factor[a, a]


@njit(cache=True, nogil=True)
def _give(offset, slack, reach, still, swing, base, give):  # type: ignore[no-untyped-def]
    """``base`` (3,) and ``give`` (3, 3) of a node."""
    for i in range(3):
        base[i] = offset[i]
        for e in range(len(still)):
            base[i] += reach[e, i] * still[e]
        for j in range(3):
            value = slack[i] if i == j else 0.0
            for e in range(len(still)):
                value += reach[e, i] * swing[e, j]
            give[i, j] = value
