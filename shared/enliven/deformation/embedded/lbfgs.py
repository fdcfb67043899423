"""The minimization of a frame's energy: L-BFGS, preconditioned with the solver's matrix.

:mod:`enliven.deformation.embedded.solver` explains the choice of the method.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from enliven.arrays import Float, Float32, Int
from enliven.deformation.embedded.energy import compute_energy_gradient
from enliven.deformation.embedded.node_frame import force_in_node_frame, step_in_node_frame
from enliven.deformation.embedded.preconditioner import (
    align_with_nodes,
    apply_preconditioner,
    is_outdated,
    refactorize_matrix,
)
from enliven.kernels import copy_row, njit
from enliven.lanes import fma8, load8, splat8, store8, total8

_REMEMBERED_STEPS = 5
"""Number of past steps that L-BFGS stores. Each of them makes a step about 3 % slower."""
_MATRIX_RENEWAL_STEPS = 12
"""Number of steps within a frame after which the matrix is computed again. The nodes have then moved far from
the state of the matrix."""
_ASSEMBLY_STEPS = 2
"""Cost, in steps, of assembling the terms of a new matrix."""
_NEGLIGIBLE_ENERGY = 1e-9
"""Energy below which a state counts as the exact minimum. With the default weights, every point is then
within 3 micrometres of its target."""
_MAX_WEIGHT_CHANGE = 0.1
"""If a weight changes by more than this fraction of the largest weight, the matrix is computed again."""
_ARMIJO_FRACTION = 1e-4
"""Minimum decrease of the energy by a step, as a fraction of the linear prediction: the usual constant of
Armijo's condition."""
_MAX_STEP_HALVINGS = 30
"""Maximum number of halvings of a step. Then the frame ends without the step: 2^-30 of a step is below
float32 resolution."""
_SOFT_DECREASE_RATIO = 1.3
"""Ratio of actual to predicted decrease, 2 - d.Hd / d.Md, above which the energy is softer than the matrix:
the second derivative H along the step d is smaller than the matrix M."""
_SOFT_TOLERANCE_FRACTION = 0.1
"""Factor on the tolerance for steps in directions in which the energy is softer than the matrix."""


_MIN_REMAINING_STEPS = 4
"""Minimum number of steps that a frame with a budget must have left. With fewer, the matrix is not renewed
because of its age."""


class CostLimit(NamedTuple):
    """The maximum cost of a frame, in steps.

    Attributes:
        room: maximum cost of a frame; infinite without a budget.
        matrix: cost of a new matrix.
        retry: cost of trying another step length.
    """

    room: float
    matrix: float
    retry: float


UNLIMITED = CostLimit(np.inf, 0.0, 0.0)
"""The allowance of a frame without budget: only the number of steps ends the frame."""


class SolverBuffers(NamedTuple):
    """The arrays of the descent for N nodes and P stored steps. Nothing else is allocated in a frame.

    Attributes:
        steps: (P, 16 N) the last steps, s.
        changes: (P, 16 N) the changes of the gradient, y.
        curvatures: (P,) the products s.y.
        now, before: (16 N,) the derivative of the energy in node frames, now and one step ago.
        own: (16 N,) the step in node frames.
        raw, from_here, trial: (16 N,) the gradient, the start of the line search, and its trial state, in the
            unknowns x.
        last: (16 N,) the unknowns one frame ago.
        energies: (6,) energies of the state: E_rot, E_reg, E_con, E_rig, E_planes and their sum E.
        age: (4,) the use of the matrix: the number of frames that used it; their steps; 1 if the last frame
            ended by its stopping rule, 0 if it ran out of steps; and the steps of the last frame.
    """

    steps: Float32
    changes: Float32
    curvatures: Float
    now: Float32
    before: Float32
    own: Float32
    raw: Float
    from_here: Float
    trial: Float
    last: Float
    energies: Float
    age: Int

    @staticmethod
    def empty(count: int) -> SolverBuffers:
        """Returns new buffers for a graph of ``count`` nodes."""
        pairs = np.zeros((2, _REMEMBERED_STEPS, 16 * count), np.float32)
        now, before, own = np.zeros((3, 16 * count), np.float32)
        raw, here, trial, last = np.zeros((4, 16 * count))
        curvatures, energies, age = np.zeros(_REMEMBERED_STEPS), np.zeros(6), np.array([0, 0, 1, 0])
        return SolverBuffers(
            pairs[0], pairs[1], curvatures, now, before, own, raw, here, trial, last, energies, age
        )


@njit(cache=True, nogil=True)
def _dot_product(u, v):
    even = odd = splat8(np.float32(0.0))
    for i in range(0, u.shape[0], 16):
        even = fma8(load8(u, i), load8(v, i), even)
        odd = fma8(load8(u, i + 8), load8(v, i + 8), odd)
    return np.float64(total8(even + odd))


@njit(cache=True, nogil=True)
def _add_then_dot(u, scale, v, w):
    """Adds ``scale`` v to u, and returns the new u.w, in one pass over u."""
    even = odd = splat8(np.float32(0.0))
    times = splat8(np.float32(scale))
    for i in range(0, u.shape[0], 16):
        low, high = fma8(times, load8(v, i), load8(u, i)), fma8(times, load8(v, i + 8), load8(u, i + 8))
        store8(u, i, low)
        store8(u, i + 8, high)
        even, odd = fma8(low, load8(w, i), even), fma8(high, load8(w, i + 8), odd)
    return np.float64(total8(even + odd))


@njit(cache=True, nogil=True)
def record_energies(work, energies):
    """Copies the six energies of the state into ``work.energies``."""
    for i in range(6):
        work.energies[i] = energies[i]


@njit(cache=True, nogil=True)
def matrix_cost_in_steps(system):
    """Returns the cost of a new matrix in steps: the number of block products of its factorization divided by
    the number of blocks of a solve."""
    return _ASSEMBLY_STEPS + system.product.shape[0] // system.row.shape[0]


@njit(cache=True, nogil=True)
def reset_age(age):
    """Resets ``age`` (see :class:`SolverBuffers`) for a new matrix."""
    age[0] = age[1] = age[3] = 0


@njit(cache=True, nogil=True)
def record_age(age, done):
    """Adds a frame of ``done`` steps to ``age`` (see :class:`SolverBuffers`)."""
    age[0] += 1
    age[1] += done
    age[3] = done


@njit(cache=True, nogil=True)
def is_aged(age, worth):
    """Returns True if a new matrix would lower the mean number of steps per frame.

    This is the case if the last frame took more steps than the mean over all frames of this matrix. The mean
    includes the cost ``worth`` of a new matrix, in steps.

    If the old matrix were kept longer, the mean would rise. This criterion needs no estimate of the number of
    steps with a new matrix.
    """
    return age[0] * age[3] > worth + age[1]


@njit(cache=True, nogil=True)
def minimize_energy(x, t, planes, system, work, most, tolerance, allowance):
    """Minimizes the energy by L-BFGS, starting from ``x``, in place. Returns the number of iterations.

    ``work.raw`` must be the gradient at ``x``, and ``work.energies`` the energies at ``x``.

    The descent ends after the first step with a predicted relative decrease of the energy below
    ``tolerance``. Normally, little of the predicted decrease remains after a step. If this step or the
    previous step gained more than predicted, the energy is softer there than the matrix. The prediction is
    then not a bound, and a smaller prediction is required.

    ``work.age[2]`` is set to 1 if the descent ended like this, and to 0 if it ended after ``most`` iterations
    or at the limit of the ``allowance``. At least one step is made. Before it, the matrix is computed if
    none exists for these constraints.
    """
    now, before = work.now, work.before
    force_in_node_frame(x, work.raw, now)
    age = work.age
    age[2] = 1
    spent = 0.0
    # Compute a new preconditioner if the old one is outdated or the constraints have changed.
    aged = (
        is_aged(age, matrix_cost_in_steps(system))
        and allowance.room >= allowance.matrix + _MIN_REMAINING_STEPS
    )
    if aged or is_outdated(t, planes, system, _MAX_WEIGHT_CHANGE):
        refactorize_matrix(x, t, planes, work.raw, system)
        reset_age(age)
        spent += allowance.matrix
    else:
        align_with_nodes(x, system)
    # Use np.int64: a literal 0 has its own Numba type, for which Numba would compile the callees again.
    kept = np.int64(0)
    soft = False
    for iteration in range(most):
        if iteration > 0 and spent >= allowance.room:
            age[2] = 0
            return iteration
        if (
            iteration > 0
            and iteration % _MATRIX_RENEWAL_STEPS == 0
            and allowance.room >= spent + allowance.matrix + _MIN_REMAINING_STEPS
        ):
            spent += allowance.matrix
            refactorize_matrix(x, t, planes, work.raw, system)
            reset_age(age)
            kept = np.int64(0)
        # Take a step in the L-BFGS direction.
        slope = compute_search_direction(now, work, kept, system)
        if not -slope > _NEGLIGIBLE_ENERGY:
            return iteration
        copy_row(before, now)
        energy = work.energies[5]
        tries = _line_search(x, slope, t, planes, work)
        spent += 1.0 + allowance.retry * (abs(tries) - 1)
        if tries < 0:
            if kept == 0:
                return iteration
            kept, soft = np.int64(0), False
            continue
        # Stop if the predicted decrease of the energy is small enough.
        was_soft, soft = soft, energy - work.energies[5] > -_SOFT_DECREASE_RATIO * 0.5 * slope
        enough = tolerance * (_SOFT_TOLERANCE_FRACTION if soft or was_soft else 1.0) * energy
        if -slope <= 2.0 * enough + _NEGLIGIBLE_ENERGY:
            return iteration + 1
        kept = _remember_step(work, kept)
    age[2] = 0
    return most


@njit(cache=True, nogil=True)
def _line_search(x, slope, t, planes, work):
    """Moves along ``work.own`` by a step length that lowers the energy. Returns the number of tested lengths,
    negative on failure.

    ``work.now`` receives the derivative at the new state, and ``work.own`` the accepted step. The full step
    is nearly always accepted.
    """
    here = work.from_here
    copy_row(here, x)
    energy, length = work.energies[5], 1.0
    for tried in range(_MAX_STEP_HALVINGS):
        step_in_node_frame(here, work.own, length, x)
        energies = compute_energy_gradient(x, t, planes, work.raw)
        if energies[5] <= energy + _ARMIJO_FRACTION * length * slope:
            record_energies(work, energies)
            force_in_node_frame(x, work.raw, work.now)
            if length < 1.0:
                for i in range(work.own.shape[0]):
                    work.own[i] *= np.float32(length)
            return tried + 1
        # The next length is at the minimum of the parabola through the two energies and the slope.
        rise = energies[5] - energy - length * slope
        best = -slope * length * length / (2.0 * rise) if np.isfinite(rise) and rise > 0.0 else 0.0
        length = max(0.1 * length, min(0.5 * length, best))
    copy_row(x, here)
    return -_MAX_STEP_HALVINGS


@njit(cache=True, nogil=True)
def _remember_step(work, kept):
    """Stores the last step and its change of the gradient. Returns the number of stored pairs, or 0 if L-BFGS
    must restart.
    """
    place = kept % _REMEMBERED_STEPS
    step, change = work.steps[place], work.changes[place]
    copy_row(step, work.own)
    for i in range(0, step.shape[0], 8):
        store8(change, i, load8(work.now, i) - load8(work.before, i))
    work.curvatures[place] = _dot_product(step, change)
    return kept + 1 if work.curvatures[place] > 0.0 else 0


@njit(cache=True, nogil=True)
def compute_search_direction(now, work, kept, system):
    """Computes the search direction into ``work.own``. Returns the slope of the energy along it.

    This is the two-loop recursion of L-BFGS (J. Nocedal 1980).
    """
    way, steps, changes = work.own, work.steps, work.changes
    for i in range(way.shape[0]):
        way[i] = -now[i]
    share = np.empty(_REMEMBERED_STEPS)
    oldest = max(0, kept - _REMEMBERED_STEPS)
    inner = _dot_product(steps[(kept - 1) % _REMEMBERED_STEPS], way)
    for k in range(kept - 1, oldest - 1, -1):
        m = k % _REMEMBERED_STEPS
        share[m] = inner / work.curvatures[m]
        inner = _add_then_dot(way, -share[m], changes[m], steps[(k - 1) % _REMEMBERED_STEPS])
    apply_preconditioner(system, way)
    inner = _dot_product(changes[oldest % _REMEMBERED_STEPS] if kept > 0 else now, way)
    for k in range(oldest, kept):
        m = k % _REMEMBERED_STEPS
        after = changes[(k + 1) % _REMEMBERED_STEPS] if k + 1 < kept else now
        inner = _add_then_dot(way, share[m] - inner / work.curvatures[m], steps[m], after)
    return inner


@njit(cache=True, nogil=True)
def run_trial_step(x, t, planes, system, work):
    """Takes and undoes a step with all pairs stored, to measure the cost of a step. Overwrites ``work``."""
    for m in range(_REMEMBERED_STEPS):
        work.curvatures[m] = 1.0
    record_energies(work, compute_energy_gradient(x, t, planes, work.raw))
    force_in_node_frame(x, work.raw, work.now)
    slope = compute_search_direction(work.now, work, np.int64(_REMEMBERED_STEPS), system)
    copy_row(work.last, x)
    _line_search(x, slope, t, planes, work)
    _remember_step(work, np.int64(0))
    copy_row(x, work.last)
    for i in range(work.now.shape[0]):
        work.steps[0, i] = work.changes[0, i] = 0.0
