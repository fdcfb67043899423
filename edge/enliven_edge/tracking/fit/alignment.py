"""Alignment of the body model with a few targets: compiled damped Gauss-Newton on points fixed to its bones.

It uses neither the surface nor the silhouette. It moves any posture close to the observed positions of a
person's head, hands and feet. The fit to depth then starts from the result.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int
from enliven.kernels import copy_row, copy_rows, njit
from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.kinematics import forward_into
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.fit import terms
from enliven_edge.tracking.fit.gauss_newton import (
    DAMPING_DECREASE,
    DAMPING_INCREASE,
    FIRST_DAMPING,
    MAX_DAMPING,
    MIN_DAMPING,
    apply_step,
    solve_damped,
)
from enliven_edge.tracking.fit.normal_equations import (
    add_point_residual,
    add_sums,
    empty_sums,
    robust,
    world_point_into,
)
from enliven_edge.tracking.fit.structures import PlacedFrames

_MIN_GAIN = 1e-3
"""Minimum gain of a step, as a fraction of the energy, to continue. The fit to depth that follows is more
exact."""
_LIMIT_WEIGHT = 100.0
"""Weight of the joint limits, square centimetres per square radian."""
REST_WEIGHTS = model.frame_weights(1.5, {model.PELVIS: 0.0, model.CHEST: 15.0, model.HEAD: 10.0})
"""(13,) weights of the prior towards the relaxed posture, square centimetres per square radian. They are
higher for the trunk, which few targets constrain. The pelvis' heading is free."""
SKELETON = (
    model.FRAME_PARENTS,
    model.PIVOTS,
    model.MOVES,
    model.DOF_FRAME,
    model.DOF_AXIS,
    model.FRAME_LENGTHS,
)
"""The model's arrays that the compiled alignment takes as arguments."""
POSTURE_LIMITS = (joint_limits.MIDDLE, joint_limits.HALF_RANGES, joint_limits.RELAXED, REST_WEIGHTS)
"""The middle and half width of the joint ranges, the relaxed posture and its weights."""


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
    """Moves the anchors of the posture ``start`` to their targets. Returns the new posture and its energy.

    The lengths do not change.

    Args:
        start: the initial posture.
        frames: (A,) the frame of each anchor, a point fixed to the body.
        local: (A, 3, 12) the anchor's position in that frame, linear in the lengths.
        targets: (A, 3) metres, world frame.
        weights: (A,) confidence of each target; 0 to ignore it.
        width: robust width in metres: a larger residual counts less.
        iterations: maximum number of steps.
    """
    aligned = start.copy()
    # Copy to a contiguous array, because numba would compile and load a second version of the kernel for a
    # view of a column.
    contiguous_weights = np.ascontiguousarray(weights)
    energy = _align(
        aligned.position, aligned.rotations, aligned.lengths, frames, local, targets,
        contiguous_weights, width, SKELETON, POSTURE_LIMITS, iterations,
    )  # fmt: skip
    return aligned, float(energy)


@njit(cache=True, nogil=True)
def _align(
    position, rotations, lengths, frames, local, targets, weights, width, skeleton, limits, iterations
):
    """Minimises the energy with Levenberg-Marquardt, updating the posture in place. Returns the energy."""
    matrix, gradient = np.zeros((model.DOFS, model.DOFS)), np.zeros(model.DOFS)
    trial_matrix, trial_gradient = np.zeros((model.DOFS, model.DOFS)), np.zeros(model.DOFS)
    step, factor = np.empty(model.DOFS), np.empty((model.DOFS, model.DOFS))
    anchors = (frames, local, targets, weights)
    energy = write_normal_equations(
        matrix, gradient, position, rotations, lengths, anchors, width, skeleton, limits
    )
    damping = FIRST_DAMPING
    for _ in range(iterations):
        solve_damped(step, factor, matrix, gradient, damping)
        moved = apply_step(position, rotations, lengths, step, skeleton[3], skeleton[4])
        lower = write_normal_equations(
            trial_matrix, trial_gradient, moved[0], moved[1], lengths, anchors, width, skeleton, limits
        )
        if not lower < energy:
            damping *= DAMPING_INCREASE
            if damping > MAX_DAMPING:
                break
            continue
        gain, energy = energy - lower, lower
        copy_row(position, moved[0])
        for f in range(len(rotations)):
            copy_rows(rotations[f], moved[1][f])
        matrix, trial_matrix = trial_matrix, matrix
        gradient, trial_gradient = trial_gradient, gradient
        damping = max(MIN_DAMPING, damping / DAMPING_DECREASE)
        if gain < _MIN_GAIN * energy:
            break
    return energy


@njit(cache=True, nogil=True)
def write_normal_equations(matrix, gradient, position, rotations, lengths, anchors, width, skeleton, limits):
    """Writes the normal equations of targets, joint ranges and relaxation.

    Returns the energy in square centimetres.
    """
    frames, local, targets, weights = anchors
    parents, offsets, moves, dof_frame, dof_axis, lengths_of = skeleton
    middle, reach, rest, ease = limits
    matrix[:], gradient[:] = 0.0, 0.0
    world, pivots = np.empty((13, 3, 3)), np.empty((13, 3))
    forward_into(world, pivots, position, rotations, lengths, parents, offsets)
    frozen = np.empty((13, 3, 0))
    body = PlacedFrames(world, pivots, frozen, moves, dof_frame, dof_axis, lengths_of, parents)
    sums = empty_sums(len(world), np.int64(0))
    point, apart, stretch = np.empty(3), np.empty(3), np.empty((3, 0))
    energy = 0.0
    for i in range(len(frames)):
        if weights[i] <= 0.0:
            continue
        world_point_into(point, frames[i], local[i], lengths, body)
        square = 0.0
        for a in range(3):
            apart[a] = point[a] - targets[i, a]
            square += apart[a] ** 2
        cost, doubt = robust(np.sqrt(square), width)
        energy += weights[i] * terms.SQUARE_CM * cost
        add_point_residual(
            sums, frames[i], point, apart, stretch, lengths_of, weights[i] * terms.SQUARE_CM * doubt
        )
    add_sums(matrix, gradient, sums, body)
    energy += terms.joint_ranges(
        matrix, gradient, rotations, middle, reach, _LIMIT_WEIGHT, dof_frame, dof_axis
    )
    energy += terms.keep_rotations_near(matrix, gradient, rotations, rest, ease, dof_frame, dof_axis)
    return energy
