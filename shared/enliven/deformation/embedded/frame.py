"""Solves a frame of the embedded deformation in one call: reads the inputs, minimizes the energy, writes the
result."""

from __future__ import annotations

from typing import NamedTuple

from enliven.arrays import Float, Int
from enliven.deformation.embedded.energy import EnergyTerms, compute_energy_gradient
from enliven.deformation.embedded.inputs import copy_usable_targets
from enliven.deformation.embedded.lbfgs import (
    CostLimit,
    SolverBuffers,
    is_aged,
    minimize_energy,
    record_age,
    record_energies,
)
from enliven.deformation.embedded.node_frame import state_from_unknowns
from enliven.deformation.embedded.safeguards import repair_inverted_nodes, restore_flat_nodes
from enliven.deformation.embedded.warm_start import choose_start
from enliven.kernels import njit

_THREAD_WAKING_COST_STEPS = 1
"""Cost, in steps, of waking the second thread and copying its matrix."""


class SolverState(NamedTuple):
    """The solver's state that persists between frames, without the matrix and the planes.

    Attributes:
        x, rest: (16 N,) the current unknowns, and the unknowns of the rest pose.
        order: (N,) the number in the graph of each node in elimination order.
        terms, work: the constants of the energy, and buffers for the descent.
        pull: factor on the weights of all constraints.
        most, tolerance: the settings ``iterations`` and ``tolerance``.
        allowance: the maximum cost of a frame, in steps.
    """

    x: Float
    rest: Float
    order: Int
    terms: EnergyTerms
    work: SolverBuffers
    pull: float
    most: int
    tolerance: float
    allowance: CostLimit


@njit(cache=True, nogil=True)
def next_frame(state, planes, system, targets, weights, linear, positions):
    """Minimizes the energy for new targets. Returns the number of iterations, and True if the matrix is
    outdated.

    No step turns a node inside out. If a node is inside out in a bad start, it is first replaced by a
    rotation. If a node is pressed flat at the end, it gets some volume again.

    Args:
        state, planes, system: a ``SolverState``, ``SolverPlanes`` and a ``RigidSystem``, each prepared by
        ``hold``.
        targets, weights: (L, 3) metres and (L,) of the constraints, unchecked.
        linear, positions: (N, 3, 3) and (N, 3) metres, output: the nodes' transforms.
    """
    f, p, s = state.values, planes.values, system.values
    x, t, work = f.x, f.terms, f.work
    copy_usable_targets(targets, weights, f.pull, t.targets, t.pulls)
    if not choose_start(x, f.rest, t, p, work):
        record_energies(work, compute_energy_gradient(x, t, p, work.raw))
    if repair_inverted_nodes(x, t.edges):
        record_energies(work, compute_energy_gradient(x, t, p, work.raw))
    done = minimize_energy(x, t, p, s, work, f.most, f.tolerance, f.allowance)
    record_age(work.age, done)
    if restore_flat_nodes(x):
        record_energies(work, compute_energy_gradient(x, t, p, work.raw))
    state_from_unknowns(x.reshape(-1, 4, 4), f.order, linear, positions)
    return done, is_aged(work.age, _THREAD_WAKING_COST_STEPS)
