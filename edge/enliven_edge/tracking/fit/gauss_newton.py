"""Levenberg-Marquardt over all terms of the fit, in one compiled loop.

The unknowns are translation (3), rotations (27) and, until the person's build is settled, lengths (12).
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import copy_row, copy_rows, njit
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.kinematics import turn
from enliven_edge.tracking.fit.structures import BodyState, FitPrior
from enliven_edge.tracking.fit.terms import assemble

_MIN_GAIN = 1e-4
"""Minimum gain of a step, as a fraction of the energy, to continue."""
_MAX_TURN = 0.5
"""Maximum rotation of a joint per step in radians. The linearisation is invalid for larger rotations."""
FIRST_DAMPING = 1e-2
"""Damping of the first step, as a fraction of the matrix's diagonal: nearly a Gauss-Newton step."""
DAMPING_INCREASE = 8.0
"""Factor on the damping after a rejected step."""
DAMPING_DECREASE = 4.0
"""Divisor of the damping after an accepted step."""
MIN_DAMPING = 1e-6
"""Minimum damping. Lower values do not change a step."""
MAX_DAMPING = 1e4
"""Maximum damping. The minimisation ends if no step with at most this damping lowers the energy."""


@njit(cache=True, nogil=True)
def minimise(
    position, rotations, lengths, observed, constants, predicted, stiffness, reference, firmness, iterations,
    support, violated, information,
):  # fmt: skip
    """Moves the posture (in place) to lower energy. Returns (energy, explained).

    Args:
        position, rotations, lengths: (3,), (13, 3, 3), (12,), as in :class:`Posture`.
        observed, constants: a :class:`SeenPerson` and :class:`FitConstants` as :class:`HeldArguments`.
        predicted, stiffness, reference, firmness: see :class:`FitPrior`.
        iterations: maximum number of steps.
        support: (C,) receives the number of points that each capsule explains.
        violated: (C,) receives the fraction of each capsule in free space.
        information: (30, 30) receives the upper triangle of the Gauss-Newton matrix at the final posture, of
            translation and rotations alone, without the temporal prior.
    """
    seen, c = observed.values, constants.values
    shape, weights = c.shape, c.weights
    lasting = (c.rest, c.relaxedness, c.middle, c.reach)
    prior = FitPrior(predicted, stiffness, *lasting, reference, firmness)
    count = model.DOFS + len(prior.firmness)
    matrix, gradient = np.zeros((count, count)), np.zeros(count)
    trial_matrix, trial_gradient = np.zeros((count, count)), np.zeros(count)
    step, factor = np.empty(count), np.empty((count, count))
    tried, tried_violated = np.empty_like(support), np.empty_like(violated)
    state = BodyState(position, rotations, lengths)
    energy, explained = assemble(matrix, gradient, state, seen, shape, prior, weights, support, violated)
    damping = FIRST_DAMPING
    for _ in range(iterations):
        # Propose a step, and compute the energy and the normal equations after it.
        solve_damped(step, factor, matrix, gradient, damping)
        moved = apply_step(position, rotations, lengths, step, shape.dof_frame, shape.dof_axis)
        lower, better = assemble(
            trial_matrix, trial_gradient, moved, seen, shape, prior, weights, tried, tried_violated
        )
        # Reject a step that does not lower the energy, and raise the damping.
        if not lower < energy:
            damping *= DAMPING_INCREASE
            if damping > MAX_DAMPING:
                break
            continue
        # Accept the step, and swap the normal equations instead of computing them again.
        gain = energy - lower
        copy_row(position, moved[0])
        for f in range(len(rotations)):
            copy_rows(rotations[f], moved[1][f])
        copy_row(lengths, moved[2])
        copy_row(support, tried)
        copy_row(violated, tried_violated)
        matrix, trial_matrix = trial_matrix, matrix
        gradient, trial_gradient = trial_gradient, gradient
        energy, explained, damping = lower, better, max(MIN_DAMPING, damping / DAMPING_DECREASE)
        if gain < _MIN_GAIN * energy:
            break
    # Compute the information matrix of the frame. It leaves out the temporal prior, which only adds to the
    # diagonal.
    for i in range(model.DOFS):
        for j in range(i, model.DOFS):
            information[i, j] = matrix[i, j]
    for k in range(len(shape.dof_frame)):
        information[3 + k, 3 + k] -= prior.stiffness[shape.dof_frame[k]]
    return energy, explained


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def cholesky(factor, matrix, damping):
    """Computes the upper Cholesky factor U of M + damping diag(M) + 0.001 = U'U.

    It uses only upper triangles. It subtracts four earlier rows at a time, so that each row is read and
    written a quarter as often.
    """
    count = len(matrix)
    for i in range(count):
        for j in range(i, count):
            factor[i, j] = matrix[i, j]
        factor[i, i] = factor[i, i] * (1.0 + damping) + 1e-3
        whole = i - i % 4
        for k in range(0, whole, 4):
            a, b, c, d = factor[k, i], factor[k + 1, i], factor[k + 2, i], factor[k + 3, i]
            for j in range(i, count):
                factor[i, j] -= (
                    a * factor[k, j] + b * factor[k + 1, j] + c * factor[k + 2, j] + d * factor[k + 3, j]
                )
        for k in range(whole, i):
            a = factor[k, i]
            for j in range(i, count):
                factor[i, j] -= a * factor[k, j]
        root = np.sqrt(max(factor[i, i], 1e-12))
        factor[i, i], inverse = root, 1.0 / root
        for j in range(i + 1, count):
            factor[i, j] *= inverse


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def solve_damped(step, factor, matrix, gradient, damping):
    """Computes step = -(M + damping diag(M) + 0.001)^-1 gradient. Reads only M's upper triangle."""
    count = len(gradient)
    cholesky(factor, matrix, damping)
    for i in range(count):
        step[i] = -gradient[i]
    for i in range(count):
        value = step[i] / factor[i, i]
        step[i] = value
        for k in range(i + 1, count):
            step[k] -= value * factor[i, k]
    for n in range(count):
        i = count - 1 - n
        value = step[i]
        for k in range(i + 1, count):
            value -= factor[i, k] * step[k]
        step[i] = value / factor[i, i]


@njit(cache=True, nogil=True)
def apply_step(position, rotations, lengths, step, dof_frame, dof_axis):
    """Returns (position, rotations, lengths) after a step. Each joint rotates by at most half a radian."""
    largest = 1e-9
    for k in range(3, model.DOFS):
        largest = max(largest, abs(step[k]))
    share = min(1.0, _MAX_TURN / largest)
    moved, turned, longer = position.copy(), rotations.copy(), lengths.copy()
    for a in range(3):
        moved[a] += share * step[a]
    turn(turned, share * step[3 : model.DOFS], dof_frame, dof_axis)
    for p in range(len(step) - model.DOFS):
        longer[p] *= min(1.25, max(0.8, 1.0 + share * step[model.DOFS + p] / lengths[p]))
    return BodyState(moved, turned, longer)
