"""Solves for weights within bounds, by the exact solution of a small quadratic program per frame and control
point.

A node is one control point at one frame. Let q (3,) be the pull (generalized force) on it, w its weights, and
r its offset from the weighted examples. They minimize

    argmin  w' M w / 2 - b' w + |r|^2 / (2 slack) + q' (C' w + r + o),      low <= w <= high.

For a fixed set of weights at their bounds, w = still - swing q and c = C' w + r + o = base - give q. The sets
of weights at their bounds are found by pivoting. At first, all wrong weights change between free and bounded
at once. If this cycles, weights change one by one (Murty's least-index rule, which always terminates).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.kernels import njit

_JOINT_CHANGE_ROUNDS = 6
"""Number of rounds in which all wrong weights are changed at once, before changing them one by one."""


@dataclass
class BoundedQuadratics:
    """The quadratic programs of P points in F frames. Each pair of point and frame is a node with E weights.

    :meth:`respond` computes ``still`` and the arrays after it.

    Attributes:
        matrix: (P, F, E, E) M, the quadratic cost of the weights.
        right: (P, F, E) b, the linear gain of the weights.
        reach: (P, F, E, 3) C, the position that each weight adds, metres.
        offset: (P, F, 3) o, the fixed part of the position, metres.
        slack: (P, F, 3) the variance of the offset r from the weighted examples. Zero along a fixed axis.
        state: (P, F, E) int8: -1 for a weight at its low bound, 0 free, 1 at its high bound, 2 unknown.
        still: (P, F, E) the weights without a pull.
        swing: (P, F, E, 3) the decrease of the weights per unit of pull.
        base: (P, F, 3) the position without a pull, metres.
        compliance: (P, F, 3, 3) the decrease of the position per unit of pull.
        min_energy: (P, F) the minimum energy without a pull.
    """

    matrix: Float
    right: Float
    reach: Float
    offset: Float
    slack: Float
    state: AnyArray
    still: Float
    swing: Float
    base: Float
    compliance: Float
    min_energy: Float

    @staticmethod
    def empty(points: int, frames: int, weight_count: int) -> BoundedQuadratics:
        """Allocates nodes. Call :meth:`reset_bounds` after filling ``matrix``, ``right`` and ``reach``."""
        shape = (points, frames)
        right, reach, offset = (
            np.empty((*shape, weight_count)),
            np.empty((*shape, weight_count, 3)),
            np.empty((*shape, 3)),
        )
        matrix, compliance, state = (
            np.empty((*shape, weight_count, weight_count)),
            np.empty((*shape, 3, 3)),
            np.empty(right.shape, np.int8),
        )
        slack, base, min_energy = np.empty_like(offset), np.empty_like(offset), np.empty(shape)
        still, swing = np.empty_like(right), np.empty_like(reach)
        return BoundedQuadratics(
            matrix, right, reach, offset, slack, state, still, swing, base, compliance, min_energy
        )

    def reset_bounds(self, slack: float) -> None:
        """Resets the nodes: it is unknown which weights are at their bounds, and offsets are zero."""
        self.offset[:] = 0.0
        self.slack[:] = slack
        self.state[:] = 2

    def solve_for_pull(self, pull: Float, low: float, high: float, places: Float) -> tuple[int, float]:
        """Computes the positions ``places`` (P, F, 3) for a pull (P, F, 3).

        Returns:
            The number of nodes in which a weight reached or left a bound, and the sum of the minimum
            energies.
        """
        lower = (self.matrix, self.right, self.reach, self.offset, self.slack, self.state)
        results = (self.still, self.swing, self.base, self.compliance, self.min_energy)
        changed, energy = solve_points_for_pull(*lower, *results, pull, low, high, places)
        return int(changed), float(energy)

    def arrays_of(self, point: int) -> tuple[tuple[AnyArray, ...], tuple[AnyArray, ...]]:
        """Returns two tuples with a point's arrays for the kernels: inputs and results."""
        names = list(self.__dataclass_fields__)
        arrays = tuple(getattr(self, name)[point] for name in names)
        return arrays[:6], arrays[6:]


@njit(cache=True, nogil=True)
def solve_points_for_pull(
    matrix, right, reach, offset, slack, state, still, swing, base, give, least, pull, low, high, places
):
    """Kernel of :meth:`BoundedQuadratics.solve_for_pull`."""
    points, frames, most = right.shape
    changed, energy = 0, 0.0
    work, marks = workspace(most), np.empty(frames, np.bool_)
    for p in range(points):
        node = (matrix[p], right[p], reach[p], offset[p], slack[p], state[p])
        results = (still[p], swing[p], base[p], give[p], least[p])
        more, part = solve_nodes(
            node, results, pull[p], np.int64(0), frames, low, high, work, places[p], marks
        )
        changed += more
        energy += part
    return changed, energy


@njit(cache=True, nogil=True)
def workspace(most):
    """Allocates the work arrays of :func:`solve_nodes`.

    They are the weights, their right-hand sides (b - C q), the numbers of the free weights, the Cholesky
    factor of their part of the matrix, and the trial states.
    """
    factor, trial = np.empty((most, most)), np.empty(most, np.int8)
    return np.empty(most), np.empty(most), np.empty(most, np.int64), factor, trial


@njit(cache=True, nogil=True)
def solve_nodes(node, known, pull, a, b, low, high, work, places, marks):
    """Kernel: computes the positions of the nodes a..b of a point for a pull (F, 3), and writes them to
    ``places``.

    ``node`` and ``known`` are the point's arrays, in the order of :class:`BoundedQuadratics`. ``marks`` (F,)
    receives True for frames in which a weight reached or left a bound.

    Returns:
        The number of these frames, and the sum of the minimum energies.
    """
    matrix, right, reach, _, _, state = node
    still, swing, base, give, least = known
    w, most = work[0], right.shape[1]
    changed, energy = 0, 0.0
    for f in range(a, b):
        qx, qy, qz = pull[f, 0], pull[f, 1], pull[f, 2]
        fits = state[f, 0] != 2
        if fits:
            for e in range(most):
                w[e] = still[f, e] - swing[f, e, 0] * qx - swing[f, e, 1] * qy - swing[f, e, 2] * qz
            for e in range(most):
                if state[f, e] == 0:
                    fits &= low - 1e-12 <= w[e] <= high + 1e-12
                else:
                    # At a bound, the energy must not decrease towards the interior. Otherwise the bound is
                    # wrong.
                    slope = reach[f, e, 0] * qx + reach[f, e, 1] * qy + reach[f, e, 2] * qz - right[f, e]
                    for k in range(most):
                        slope += matrix[f, e, k] * w[k]
                    fits &= state[f, e] * slope <= 1e-12 * matrix[f, e, e]
        if not fits:
            _update_weights(node, known, f, qx, qy, qz, low, high, work)
            changed += 1
        marks[f] = not fits
        cx = base[f, 0] - give[f, 0, 0] * qx - give[f, 0, 1] * qy - give[f, 0, 2] * qz
        cy = base[f, 1] - give[f, 1, 0] * qx - give[f, 1, 1] * qy - give[f, 1, 2] * qz
        cz = base[f, 2] - give[f, 2, 0] * qx - give[f, 2, 1] * qy - give[f, 2, 2] * qz
        places[f, 0], places[f, 1], places[f, 2] = cx, cy, cz
        # The positions are the gradient of the minimum energy. Within one quadratic piece they are exact.
        along = qx * (base[f, 0] + cx) + qy * (base[f, 1] + cy) + qz * (base[f, 2] + cz)
        energy += least[f] + 0.5 * along
    return changed, energy


@njit(cache=True, nogil=True)
def _update_weights(node, known, f, qx, qy, qz, low, high, work):
    """Determines which weights of node f are at their bounds, and the resulting linear terms."""
    matrix, right, reach, _, _, state = node
    _, g, _, _, trial = work
    for e in range(len(g)):
        g[e] = right[f, e] - reach[f, e, 0] * qx - reach[f, e, 1] * qy - reach[f, e, 2] * qz
        trial[e] = 0 if state[f, 0] == 2 else state[f, e]
    _pivot_states(matrix, f, work, low, high)
    for e in range(len(g)):
        state[f, e] = trial[e]
    _linear_terms(node, known, f, qx, qy, qz, work)


@njit(cache=True, nogil=True, inline="always")
def _first_wrong_weight(matrix, f, g, state, w, low, high):
    """Returns the first weight that is out of bounds or should leave its bound, or -1 if there is none."""
    for e in range(len(w)):
        if _is_wrong(matrix, f, g, state, w, low, high, e):
            return e
    return -1


@njit(cache=True, nogil=True, inline="always")
def _is_wrong(matrix, f, g, state, w, low, high, e):
    if state[e] == 0:
        return w[e] < low - 1e-12 or w[e] > high + 1e-12
    slope = -g[e]
    for b in range(len(w)):
        slope += matrix[f, e, b] * w[b]
    return -state[e] * slope < -1e-12 * matrix[f, e, e]


@njit(cache=True, nogil=True, inline="always")
def _pivot_states(matrix, f, work, low, high):
    """Finds the states and weights for g = b - C q by pivoting, starting at the trial states."""
    w, g, _, _, state = work
    most = len(w)
    for turn in range(_JOINT_CHANGE_ROUNDS + 50 * 2 ** min(most, 12)):
        _fill_weights(matrix, f, work, _factor_free_part(matrix, f, work), low, high)
        first = _first_wrong_weight(matrix, f, g, state, w, low, high)
        if first < 0:
            return
        last = most if turn < _JOINT_CHANGE_ROUNDS else first + 1
        # Decide for all weights from the same values. They do not change within this loop.
        for e in range(first, last):
            if _is_wrong(matrix, f, g, state, w, low, high, e):
                state[e] = 0 if state[e] != 0 else (-1 if w[e] < low else 1)


@njit(cache=True, nogil=True, inline="always")
def _factor_free_part(matrix, f, work):
    """Computes the Cholesky factor of the free weights' part, with its diagonal inverted. Returns their
    number."""
    _, _, free, factor, state = work
    count = 0
    for e in range(len(state)):
        if state[e] == 0:
            free[count] = e
            count += 1
    for a in range(count):
        for b in range(a + 1):
            value = matrix[f, free[a], free[b]]
            for k in range(b):
                value -= factor[a, k] * factor[b, k]
            factor[a, b] = 1.0 / np.sqrt(max(value, 1e-14)) if a == b else value * factor[b, b]
    return count


@njit(cache=True, nogil=True, inline="always")
def _fill_weights(matrix, f, work, count, low, high):
    """Computes all weights. Weights at a bound get the value of the bound, and free weights solve the
    remaining system with the right-hand side g.
    """
    w, g, free, factor, state = work
    for e in range(len(w)):
        if state[e] != 0:
            w[e] = low if state[e] < 0 else high
    for a in range(count):
        value = g[free[a]]
        if count < len(w):
            for e in range(len(w)):
                if state[e] != 0:
                    value -= matrix[f, free[a], e] * w[e]
        for k in range(a):
            value -= factor[a, k] * w[free[k]]
        w[free[a]] = value * factor[a, a]
    for a in range(count - 1, -1, -1):
        value = w[free[a]]
        for k in range(a + 1, count):
            value -= factor[k, a] * w[free[k]]
        w[free[a]] = value * factor[a, a]


@njit(cache=True, nogil=True, inline="always")
def _linear_terms(node, known, f, qx, qy, qz, work):
    """Computes the linear terms (``still``, ``swing``, ``base``, ``give``) of a node. Its states, factor and
    weights for the pull are in ``work``."""
    matrix, right, reach, offset, slack, _ = node
    still, swing, base, give, least = known
    w, _, free, factor, state = work
    most = len(w)
    count = 0
    for e in range(most):
        count += state[e] == 0
        swing[f, e, 0], swing[f, e, 1], swing[f, e, 2] = 0.0, 0.0, 0.0
    # Forward substitution: solve the free part for the three axes of reach.
    for a in range(count):
        x, y, z = reach[f, free[a], 0], reach[f, free[a], 1], reach[f, free[a], 2]
        for k in range(a):
            b, times = free[k], factor[a, k]
            x, y, z = x - times * swing[f, b, 0], y - times * swing[f, b, 1], z - times * swing[f, b, 2]
        over, b = factor[a, a], free[a]
        swing[f, b, 0], swing[f, b, 1], swing[f, b, 2] = x * over, y * over, z * over
    # Back substitution. ``swing`` is now the response of the free weights to a pull.
    for a in range(count - 1, -1, -1):
        e = free[a]
        x, y, z = swing[f, e, 0], swing[f, e, 1], swing[f, e, 2]
        for k in range(a + 1, count):
            b, times = free[k], factor[k, a]
            x, y, z = x - times * swing[f, b, 0], y - times * swing[f, b, 1], z - times * swing[f, b, 2]
        over = factor[a, a]
        swing[f, e, 0], swing[f, e, 1], swing[f, e, 2] = x * over, y * over, z * over
    # Start from the fixed offset and the slack. Then add the contribution of each weight.
    for i in range(3):
        base[f, i] = offset[f, i]
        for j in range(3):
            give[f, i, j] = slack[f, i] if i == j else 0.0
    energy = 0.0
    for e in range(most):
        at = w[e] + swing[f, e, 0] * qx + swing[f, e, 1] * qy + swing[f, e, 2] * qz
        still[f, e] = at
        row = 0.5 * matrix[f, e, e] * at - right[f, e]
        for b in range(e):
            row += matrix[f, e, b] * still[f, b]
        energy += at * row
        for i in range(3):
            base[f, i] += reach[f, e, i] * at
            for j in range(3):
                give[f, i, j] += reach[f, e, i] * swing[f, e, j]
    least[f] = energy
