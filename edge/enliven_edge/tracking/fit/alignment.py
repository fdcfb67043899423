"""Bringing the body model to a few targets: damped Gauss-Newton of anchors on its bones, compiled.

No surface, no silhouette: it takes a posture from anywhere to about where somebody's head, hands and feet
were seen, so that the fit proper can begin.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int
from enliven.kernels import copy_row, copy_rows, njit
from enliven_edge.tracking.body_model import Posture, forward_into, joint_limits, model
from enliven_edge.tracking.fit import terms
from enliven_edge.tracking.fit.gauss_newton import solve_damped, stepped
from enliven_edge.tracking.fit.normal_equations import add_place, gather, no_sums

_SQUARE_CM = 1e4
_RANGES, _RELAXED = 100.0, 1.5
_REST = joint_limits.standing()
_EASE = np.full(13, _RELAXED)
_EASE[model.PELVIS] = 0.0
_EASE[[model.CHEST, model.HEAD]] = 15.0, 10.0
_SKELETON = (
    model.FRAME_PARENTS,
    model.PIVOTS,
    model.MOVES,
    model.DOF_FRAME,
    model.DOF_AXIS,
    model.FRAME_LENGTHS,
)
_LIMITS = (joint_limits.MIDDLE, joint_limits.REACH, _REST, _EASE)


def align(
    start: Posture,
    frames: Int,
    local: Float,
    targets: Float,
    weights: Float,
    *,
    width: float = 0.2,
    iterations: int = 20,
) -> tuple[Posture, float]:
    """The posture near ``start`` whose anchors are at the targets, its lengths kept; and its energy.

    Args:
        frames: (A,) the frame that carries each anchor.
        local: (A, 3, 12) where it is in that frame, linear in the lengths.
        targets: (A, 3) metres, world frame.
        weights: (A,) how sure each target is; 0 for none.
        width: metres beyond which a target is doubted.
    """
    made = start.copy()
    sure = np.ascontiguousarray(weights)  # a column's view would be compiled, and loaded, a second time
    energy = _align(
        made.position, made.rotations, made.lengths, frames, local, targets, sure, width, _SKELETON,
        _LIMITS, iterations,
    )  # fmt: skip
    return made, float(energy)


@njit(cache=True, nogil=True)
def _align(  # type: ignore[no-untyped-def]
    position, rotations, lengths, frames, local, targets, weights, width, skeleton, limits, iterations
):
    """Levenberg-Marquardt, the posture in place; returns the energy."""
    matrix, gradient = np.zeros((30, 30)), np.zeros(30)
    trial_matrix, trial_gradient = np.zeros((30, 30)), np.zeros(30)
    step, factor = np.empty(30), np.empty((30, 30))
    wanted = (frames, local, targets, weights)
    energy = _normal_equations(
        matrix, gradient, position, rotations, lengths, wanted, width, skeleton, limits
    )
    damping = 1e-2
    for _ in range(iterations):
        solve_damped(step, factor, matrix, gradient, damping)
        moved = stepped(position, rotations, lengths, step, skeleton[3], skeleton[4])
        lower = _normal_equations(
            trial_matrix, trial_gradient, moved[0], moved[1], lengths, wanted, width, skeleton, limits
        )
        if not lower < energy:
            damping *= 8.0
            if damping > 1e4:
                break
            continue
        gain, energy = energy - lower, lower
        copy_row(position, moved[0])
        for f in range(len(rotations)):
            copy_rows(rotations[f], moved[1][f])
        matrix, trial_matrix = trial_matrix, matrix
        gradient, trial_gradient = trial_gradient, gradient
        damping = max(1e-6, damping / 4.0)
        if gain < 1e-3 * energy:
            break
    return energy


@njit(cache=True, nogil=True)
def _normal_equations(  # type: ignore[no-untyped-def]
    matrix, gradient, position, rotations, lengths, wanted, width, skeleton, limits
):
    """Of the targets (square centimetres by their weights), the joints' ranges and standing relaxed."""
    frames, local, targets, weights = wanted
    parents, offsets, moves, dof_frame, dof_axis, lengths_of = skeleton
    middle, reach, rest, ease = limits
    matrix[:], gradient[:] = 0.0, 0.0
    world, pivots = np.empty((13, 3, 3)), np.empty((13, 3))
    forward_into(world, pivots, position, rotations, lengths, parents, offsets)
    frozen = np.empty((13, 3, 0))
    body = (world, pivots, frozen, moves, dof_frame, dof_axis, lengths_of, parents)
    sums = no_sums(len(world), np.int64(0))
    point, apart, stretch = np.empty(3), np.empty(3), np.empty((3, 0))
    energy = 0.0
    for i in range(len(frames)):
        if weights[i] <= 0.0:
            continue
        terms.carried(point, frames[i], local[i], lengths, body)
        square = 0.0
        for a in range(3):
            apart[a] = point[a] - targets[i, a]
            square += apart[a] ** 2
        cost, doubt = terms.robust(np.sqrt(square), width)
        energy += weights[i] * _SQUARE_CM * cost
        add_place(sums, frames[i], point, apart, stretch, lengths_of, weights[i] * _SQUARE_CM * doubt)
    gather(matrix, gradient, sums, body)
    energy += terms.joint_ranges(matrix, gradient, rotations, middle, reach, _RANGES, dof_frame, dof_axis)
    energy += terms.stay_near(matrix, gradient, rotations, rest, ease, dof_frame, dof_axis)
    return energy
