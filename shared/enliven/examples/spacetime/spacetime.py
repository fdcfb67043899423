"""Solves the spacetime problem exactly over all frames and control points, with bounded weights.

Section 5, eq. 24. With weights w, offsets r from the weighted examples, and c = C w + r + middle, it is

    minimise  sum of the nodes' energies + lambda^2 |A c|^2 / 2     with H c = h and low <= w <= high.

Here A computes second differences over frames, and ``middle`` is the mean position in the examples. Positions
are eliminated node by node. Velocities and couplings (H) have Lagrange multipliers, which border the banded
system. Because of the bounds, the response of a node to a pull is piecewise linear. Newton's method on the
dual, which is convex and once differentiable, solves the band for the current pieces until no piece changes.
Every step is a banded solve, and is shortened if the dual would not decrease.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Int
from enliven.examples.spacetime.banded import Band, apply_transposed_differences, compute_accelerations
from enliven.examples.spacetime.bounded import BoundedQuadratics
from enliven.examples.spacetime.constraints import Conditions
from enliven.examples.spacetime.newton import solve_point
from enliven.kernels import njit

_MAX_NEWTON_STEPS = 60
"""Maximum number of Newton steps. The iteration ends earlier with an exact solution if a step changes no
quadratic piece."""
_MIN_STEP_FRACTION = 1e-6
"""Minimum fraction of a Newton step in the line search."""


@dataclass(frozen=True, eq=False)
class Solution:
    """The positions of the control points.

    Attributes:
        places: (P, F, 3) in the nodes' unit.
        work: number of factored block rows, to which the computing time is proportional.
    """

    places: Float
    work: int


def solve(
    nodes_of: Callable[[list[int], BoundedQuadratics | None], BoundedQuadratics],
    conditions: Conditions,
    weight: float,
    bounds: tuple[float, float],
    workers: Executor | None = None,
    only: Sequence[int] | None = None,
) -> Solution:
    """Solves all points: coupled points together, and the other points one by one.

    Args:
        nodes_of: builds the nodes of some points, reusing the memory of finished nodes.
        conditions: the constraints of P points and F frames.
        weight: lambda (see the module), with frames as the unit of time.
        bounds: lower and upper bound of the weights.
        workers: threads that share the points; None solves them sequentially.
        only: the points to solve, or None for all points. The positions of the other points are 0.
    """
    places = np.zeros(conditions.held.shape)
    # Reuse the memory of finished nodes, because allocating new memory takes as long as the computation.
    spare: list[BoundedQuadratics] = []

    def one(group: list[int]) -> int:
        nodes = nodes_of(group, spare.pop() if spare and len(group) == 1 else None)
        held, values = conditions.held[group], conditions.values[group]
        _eliminate_held(held, values, nodes.matrix, nodes.right, nodes.reach, nodes.offset, nodes.slack)
        is_in_group = (
            np.isin(conditions.first[:, 0], group) if len(conditions.first) else np.zeros(0, np.bool_)
        )
        if not is_in_group.any():
            factored = solve_point(*nodes.arrays_of(0), weight, *bounds, places[group[0]])
            spare.append(nodes)
            return int(factored)
        local = np.zeros(len(places), np.int64)
        local[group] = np.arange(len(group))
        first, second = conditions.first[is_in_group].copy(), conditions.second[is_in_group].copy()
        first[:, 0], second[:, 0] = local[first[:, 0]], local[second[:, 0]]
        system = _System(nodes, (first, second), conditions.difference[is_in_group], weight, bounds)
        places[group] = system.solve()
        return system.work

    groups = _coupled_groups(len(places), conditions)
    if only is not None:
        groups = [group for group in groups if set(group) & set(only)]
    work = sum(workers.map(one, groups) if workers else map(one, groups))
    return Solution(places, work)


@njit(cache=True, nogil=True)
def _eliminate_held(held, values, matrix, right, reach, offset, slack):
    """Eliminates in place the coordinates that are fixed: those with ``held`` (P, F, 3) True have the
    positions ``values``.

    The offset r is the difference between a held coordinate and C w. Its cost becomes part of the weights'
    energy.
    """
    count = reach.shape[2]
    for p in range(held.shape[0]):
        for f in range(held.shape[1]):
            for axis in range(3):
                if not held[p, f, axis]:
                    continue
                value, cost = values[p, f, axis], slack[p, f, axis]
                for a in range(count):
                    column = reach[p, f, a, axis] / cost
                    right[p, f, a] += column * value
                    for b in range(count):
                        matrix[p, f, a, b] += column * reach[p, f, b, axis]
                for a in range(count):
                    reach[p, f, a, axis] = 0.0
                offset[p, f, axis], slack[p, f, axis] = value, 0.0


def _coupled_groups(points: int, conditions: Conditions) -> list[list[int]]:
    """Returns groups of points that are connected by couplings."""
    group = list(range(points))
    for a, b in zip(conditions.first[:, 0], conditions.second[:, 0], strict=True):
        old, new = group[a], group[b]
        group = [new if label == old else label for label in group]
    return [[p for p in range(points) if group[p] == label] for label in dict.fromkeys(group)]


class _System:
    """The system of one group of coupled points. Its unknowns are y (P, F - 2, 3), the accelerations times
    lambda, and the Lagrange multipliers (R,).
    """

    def __init__(
        self,
        nodes: BoundedQuadratics,
        links: tuple[Int, Int],
        difference: Float,
        weight: float,
        bounds: tuple[float, float],
    ) -> None:
        self._nodes, self._weight, self._bounds = nodes, weight, bounds
        self._first, self._second = (tuple(ends.T) for ends in links)
        self._difference = difference
        self._points, self._frames = nodes.right.shape[:2]
        self.work = 0

    def solve(self) -> Float:
        """Solves the positions (P, F, 3)."""
        y = np.zeros((self._points, max(self._frames - 2, 0), 3))
        nu = np.zeros(len(self._difference))
        places = np.empty((self._points, self._frames, 3))
        _, value = self._evaluate_nodes(y, nu, places)
        for _ in range(_MAX_NEWTON_STEPS):
            to_y, to_nu = self._solve_newton()
            changed, new = self._evaluate_nodes(to_y, to_nu, places)
            if changed == 0:
                break
            # Halve the step until the dual energy does not increase.
            step_fraction = 1.0
            while new > value + 1e-12 * (abs(value) + 1.0) and step_fraction > _MIN_STEP_FRACTION:
                step_fraction *= 0.5
                mid = y + step_fraction * (to_y - y), nu + step_fraction * (to_nu - nu)
                _, new = self._evaluate_nodes(*mid, places)
            y, nu, value = y + step_fraction * (to_y - y), nu + step_fraction * (to_nu - nu), new
        return places

    def _evaluate_nodes(self, y: Float, nu: Float, places: Float) -> tuple[int, float]:
        """Evaluates the nodes for y and nu, and writes the positions to ``places``. Returns the number of
        changed nodes, and the dual energy."""
        changed, energy = self._nodes.solve_for_pull(self._pull_of(y, nu), *self._bounds, places)
        return changed, 0.5 * float((y * y).sum()) + float(nu @ self._difference) - energy

    def _pull_of(self, y: Float, nu: Float) -> Float:
        """Computes the pull q = lambda A' y + H' nu (P, F, 3) on the nodes."""
        pull = self._weight * apply_transposed_differences(y, self._frames)
        np.add.at(pull, self._first, nu)
        np.subtract.at(pull, self._second, nu)
        return pull

    def _solve_newton(self) -> tuple[Float, Float]:
        """Computes the y and nu that minimize the current quadratic pieces."""
        bands = [Band(give, self._weight) for give in self._nodes.compliance]
        self.work += sum(band.work for band in bands)
        base, rows = self._nodes.base, len(self._difference)
        right = self._weight * compute_accelerations(base)
        y = np.stack([band.solve(r[..., None])[..., 0] for band, r in zip(bands, right, strict=True)])
        if rows == 0:
            return y, np.zeros(0)
        response = self._multiplier_response(rows)
        border = self._weight * compute_accelerations(np.moveaxis(response, 3, 1))
        border = np.moveaxis(border, 1, 3)
        through = np.stack([band.solve(b) for band, b in zip(bands, border, strict=True)])
        small = response[self._first] - response[self._second] - np.einsum("pfir,pfis->rs", border, through)
        gap = base[self._first] - base[self._second] - self._difference
        nu = np.linalg.solve(small, gap - np.einsum("pfir,pfi->r", border, y))
        return y - through @ nu, nu

    def _multiplier_response(self, rows: int) -> Float:
        """Computes the response ``give`` H' (P, F, 3, R) of the positions to the multipliers."""
        out = np.zeros((self._points, self._frames, 3, rows))
        for r in range(rows):
            for ends, sign in ((self._first, 1.0), (self._second, -1.0)):
                p, f, axis = (int(end[r]) for end in ends)
                out[p, f, :, r] += sign * self._nodes.compliance[p, f, :, axis]
        return out
