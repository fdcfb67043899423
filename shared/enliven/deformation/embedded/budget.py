"""Converts a budget in milliseconds to a number of steps. The cost of a step is measured in advance on this
machine.

No clock is read while a frame is solved. On a machine that is busy with other programs, a clock could end a
frame before its first step. The mesh would then lag behind even more than the late image.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from enliven.arrays import Float
from enliven.deformation.embedded.energy import EnergyTerms, SolverPlanes, compute_energy_gradient
from enliven.deformation.embedded.lbfgs import CostLimit, SolverBuffers, run_trial_step
from enliven.deformation.embedded.preconditioner import RigidSystem, refactorize_matrix

_MEASURED_COSTS_MS: dict[tuple[int, int], tuple[float, float, float]] = {}
"""Measured milliseconds of a step, a matrix and a gradient, by the graph's number of nodes and edges. They
are cached, because a measurement takes as long as a frame."""
_TIMING_REPEATS = 4
"""Number of measurements of each cost. Their minimum is taken as the cost on an idle machine."""
_FIXED_FRAME_COST_STEPS = 2.0
"""Cost of a frame's fixed parts, in steps: choosing its start, and writing the result."""


def measure_allowance(
    budget_ms: float, x: Float, terms: EnergyTerms, planes: SolverPlanes, system: RigidSystem
) -> CostLimit:
    """Returns the allowance of a frame for a budget in milliseconds.

    The costs are measured at the state ``x`` (16 N,).
    """
    size = len(terms.stretch), len(terms.edges)
    if size not in _MEASURED_COSTS_MS:
        work = SolverBuffers.empty(len(terms.stretch))
        state = x.copy()
        matrix = _fastest_run_ms(lambda: refactorize_matrix(state, terms, planes, work.raw, system))
        step = _fastest_run_ms(lambda: run_trial_step(state, terms, planes, system, work))
        _MEASURED_COSTS_MS[size] = (
            step,
            matrix,
            _fastest_run_ms(lambda: compute_energy_gradient(state, terms, planes, work.raw)),
        )
    step, matrix, retry = _MEASURED_COSTS_MS[size]
    return CostLimit(budget_ms / step - _FIXED_FRAME_COST_STEPS, matrix / step, retry / step)


def _fastest_run_ms(function: Callable[[], object]) -> float:
    """Returns the milliseconds of the fastest of several runs. An additional first run compiles the
    kernels."""
    function()
    fastest_ms = float("inf")
    for _ in range(_TIMING_REPEATS):
        begin = time.perf_counter()
        function()
        fastest_ms = min(fastest_ms, 1e3 * (time.perf_counter() - begin))
    return max(fastest_ms, 1e-6)
