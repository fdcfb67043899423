"""A frame's descent: L-BFGS around the frame's own matrix, in compiled loops.

See :mod:`enliven.deformation.embedded.solver` for why it is made like this.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from enliven.arrays import Float
from enliven.deformation.embedded.energy import gradient
from enliven.deformation.embedded.node_frame import force_in_node_frame, step_from_node_frame
from enliven.deformation.embedded.preconditioner import outdated, precondition, refactor
from enliven.deformation.embedded.safeguards import set_upright
from enliven.deformation.embedded.warm_start import choose_start
from enliven.kernels import copy_row, njit
from enliven.lanes import fma4, load4, store4, total4

_PAIRS = 5
"""Steps after which the matrix is refactored. A matrix that ends its frames sooner is kept for the next
frame: its cost is saved, and L-BFGS makes up for the rotations since."""
_NEGLIGIBLE = 1e-9
"""An energy that is invisible: with the default weights, every point 3 micrometres off."""
_REPULLED = 0.1
"""How far weights may change, as a part of the strongest, before the matrix is made anew."""
_ARMIJO = 1e-4
"""Share of the linear decrease that a step must reach: the usual constant of Armijo's condition."""
_HALVINGS = 30
"""Halvings of a step before the frame ends without it: 2^-30 of a step is below what float32 shows."""


class SolverBuffers(NamedTuple):
    """The arrays of the descent for N nodes, P step pairs; nothing else is allocated in a frame.

    Attributes:
        steps: (P, 16 N) the last steps, s.
        changes: (P, 16 N) the changes of the gradient, y.
        curvatures: (P,) s.y.
        now, before: (16 N,) the derivative in the node frames, here and one step ago.
        own: (16 N,) the step in the node frames.
        raw, way, bend, from_here, trial: (16 N,) in the plain unknowns.
        last: (16 N,) the unknowns one frame ago.
        energies: (6,) of the state: E_rot, E_reg, E_con, E_rig, E_planes, E.
    """

    steps: Float
    changes: Float
    curvatures: Float
    now: Float
    before: Float
    own: Float
    raw: Float
    way: Float
    bend: Float
    from_here: Float
    trial: Float
    last: Float
    energies: Float

    @staticmethod
    def empty(count: int) -> SolverBuffers:
        """For ``count`` nodes."""
        pairs = np.zeros((2, _PAIRS, 16 * count))
        now, before, own, raw, way, bend, here, trial, last = np.zeros((9, 16 * count))
        curvatures, energies = np.zeros(_PAIRS), np.zeros(6)
        return SolverBuffers(
            pairs[0], pairs[1], curvatures, now, before, own, raw, way, bend, here, trial, last, energies
        )


@njit(cache=True, nogil=True)
def _dot(u, v):  # type: ignore[no-untyped-def]
    total = load4(u, 0) * load4(v, 0)
    for i in range(4, u.shape[0], 4):
        total = total + load4(u, i) * load4(v, i)
    return total4(total)


@njit(cache=True, nogil=True)
def _add_scaled(u, scale, v):  # type: ignore[no-untyped-def]
    for i in range(0, u.shape[0], 4):
        store4(u, i, fma4(scale, load4(v, i), load4(u, i)))


@njit(cache=True, nogil=True)
def solve_frame(x, rest, t, planes, system, work, most, tolerance):  # type: ignore[no-untyped-def]
    """Kernel: minimise the energy from ``x``, in place; returns the number of iterations.

    No node is left inside out: where the descent ends with one, it is set upright and the descent goes on.
    """
    if not choose_start(x, rest, t, planes, work):
        record_energies(work, gradient(x, t, planes, work.raw))
    done = descend(x, t, planes, system, work, most, tolerance)
    for _ in range(2):
        if not set_upright(x, t.edges):
            return done
        record_energies(work, gradient(x, t, planes, work.raw))
        done += descend(x, t, planes, system, work, most, tolerance)
    if set_upright(x, t.edges):
        record_energies(work, gradient(x, t, planes, work.raw))
    return done


@njit(cache=True, nogil=True)
def record_energies(work, energies):  # type: ignore[no-untyped-def]
    """Copy the six energies of the state into the workspace."""
    for i in range(6):
        work.energies[i] = energies[i]


@njit(cache=True, nogil=True)
def descend(x, t, planes, system, work, most, tolerance):  # type: ignore[no-untyped-def]
    """Kernel: L-BFGS from ``x``, in place; returns the number of iterations. ``work.raw`` is the gradient at
    ``x``, ``work.energies`` are its energies.

    It ends with the first step with a predicted decrease below ``tolerance`` of the energy. A step leaves
    only a small part of its predicted decrease, and one more test would cost as much as a step.
    """
    now, before = work.now, work.before
    force_in_node_frame(x, work.raw, now)
    kept = np.int64(0)  # a plain 0 is a type of its own, for which the callees would be compiled again
    for iteration in range(most):
        if kept == 0 and (iteration > 0 or outdated(t, planes, system, _REPULLED)):
            refactor(x, t, planes, system)
        slope = _direction(now, work, kept, system)
        if not -slope > _NEGLIGIBLE:
            return iteration
        copy_row(before, now)
        energy = work.energies[5]
        if not _step(x, slope, t, planes, work):
            if kept == 0:
                return iteration
            kept = np.int64(0)
            continue
        if -slope <= 2.0 * tolerance * energy + _NEGLIGIBLE:
            return iteration + 1
        kept = _remember(work, kept)
    return most


@njit(cache=True, nogil=True)
def _step(x, slope, t, planes, work):  # type: ignore[no-untyped-def]
    """Go along ``work.own``, bent as the nodes turn, as far as it lowers the energy; False where it does not.

    ``work.now`` takes the derivative there, and ``work.own`` the part that was gone. The full step is nearly
    always the right one.
    """
    here, way, bend = work.from_here, work.way, work.bend
    copy_row(here, x)
    step_from_node_frame(x, work.own, way, bend)
    energy, length = work.energies[5], 1.0
    for _ in range(_HALVINGS):
        for i in range(0, x.shape[0], 4):
            ahead = fma4(length, load4(way, i), load4(here, i))
            store4(x, i, fma4(length * length, load4(bend, i), ahead))
        energies = gradient(x, t, planes, work.raw)
        if energies[5] <= energy + _ARMIJO * length * slope:
            record_energies(work, energies)
            force_in_node_frame(x, work.raw, work.now)
            for i in range(work.own.shape[0]):
                work.own[i] *= length
            return True
        # The parabola through the two energies and the slope.
        rise = energies[5] - energy - length * slope
        best = -slope * length * length / (2.0 * rise) if np.isfinite(rise) and rise > 0.0 else 0.0
        length = max(0.1 * length, min(0.5 * length, best))
    copy_row(x, here)
    return False


@njit(cache=True, nogil=True)
def _remember(work, kept):  # type: ignore[no-untyped-def]
    """Keep the last step and its change of the gradient; returns the count of kept pairs, 0 to restart."""
    if kept == _PAIRS:
        return 0
    step, change = work.steps[kept], work.changes[kept]
    copy_row(step, work.own)
    for i in range(0, step.shape[0], 4):
        store4(change, i, load4(work.now, i) - load4(work.before, i))
    work.curvatures[kept] = _dot(step, change)
    return kept + 1 if work.curvatures[kept] > 0.0 else 0


@njit(cache=True, nogil=True)
def _direction(now, work, kept, system):  # type: ignore[no-untyped-def]
    """``work.own`` takes where to go; returns the slope there. The two loops of L-BFGS (J. Nocedal 1980)."""
    way = work.own
    for i in range(way.shape[0]):
        way[i] = -now[i]
    share = np.empty(_PAIRS)
    for m in range(kept - 1, -1, -1):
        share[m] = _dot(work.steps[m], way) / work.curvatures[m]
        _add_scaled(way, -share[m], work.changes[m])
    precondition(system, way)
    for m in range(kept):
        _add_scaled(way, share[m] - _dot(work.changes[m], way) / work.curvatures[m], work.steps[m])
    return _dot(now, way)
