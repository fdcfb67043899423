"""A budget in milliseconds, as a count of steps: what one costs is timed beforehand, on this machine.

No clock is read while a frame is solved: where others load the machine, a clock would end a frame early that
has done nothing, and the mesh would lag behind when the picture is late already.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from enliven.arrays import Float
from enliven.deformation.embedded.energy import Planes, Terms, gradient
from enliven.deformation.embedded.lbfgs import Allowance, SolverBuffers, full_step
from enliven.deformation.embedded.preconditioner import RigidSystem, refactor

_COSTS: dict[tuple[int, int], tuple[float, float, float]] = {}
"""Milliseconds of a step, a matrix and a gradient, by a graph's nodes and edges: a hold that begins again
does not time them again, which takes a frame."""
_REPEATS = 4
"""Times that each kind of work is timed: the least is what it costs on an idle machine."""
_BEFORE = 2.0
"""Steps that take as long as what a frame begins and ends with: its start, and its state handed out."""


def allowance_of(budget_ms: float, x: Float, terms: Terms, planes: Planes, system: RigidSystem) -> Allowance:
    """What a frame of ``budget_ms`` has room for; ``x`` (16 N,) is the state at which the work is timed."""
    size = len(terms.stretch), len(terms.edges)
    if size not in _COSTS:
        work = SolverBuffers.empty(len(terms.stretch))
        at = x.copy()
        matrix = _least_ms(lambda: refactor(at, terms, planes, work.raw, system))
        step = _least_ms(lambda: full_step(at, terms, planes, system, work))
        _COSTS[size] = step, matrix, _least_ms(lambda: gradient(at, terms, planes, work.raw))
    step, matrix, retry = _COSTS[size]
    return Allowance(budget_ms / step - _BEFORE, matrix / step, retry / step)


def _least_ms(do: Callable[[], object]) -> float:
    """Milliseconds of the fastest of several runs, after one that compiles."""
    do()
    least = float("inf")
    for _ in range(_REPEATS):
        begin = time.perf_counter()
        do()
        least = min(least, 1e3 * (time.perf_counter() - begin))
    return max(least, 1e-6)
