"""Tests of the L-BFGS two-loop recursion against a plain implementation."""

from functools import cache

import numpy as np
import pytest
from creatures import random_problem
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.deformation.embedded.inputs import NO_PLANES
from enliven.deformation.embedded.lbfgs import SolverBuffers, compute_search_direction
from enliven.deformation.embedded.preconditioner import apply_preconditioner, refactorize_matrix
from enliven.deformation.embedded.solver import EmbeddedSolver


@cache
def system():
    """Returns the matrix of a small creature at rest."""
    problem = random_problem(5, 21, 1, 1.0)
    solver = EmbeddedSolver(problem.graph, problem.points)
    solver.store_targets(problem.targets[0], np.ones(len(problem.targets[0])))
    x = solver.unknowns.reshape(-1)
    refactorize_matrix(x, solver.terms, NO_PLANES, np.zeros_like(x), solver.current_matrix)
    return solver.current_matrix


def filled_buffers(count, seed):
    """Returns buffers with random pairs of positive curvature, and a random gradient."""
    work, rng = SolverBuffers.empty(count), np.random.default_rng(seed)
    used = np.arange(16 * count) % 4 < 3
    work.now[:] = np.where(used, rng.normal(size=16 * count), 0.0)
    for m, (step, change) in enumerate(zip(work.steps, work.changes, strict=True)):
        step[:] = np.where(used, rng.normal(size=16 * count), 0.0)
        change[:] = step + 0.5 * np.where(used, rng.normal(size=16 * count), 0.0)
        work.curvatures[m] = step.astype(np.float64) @ change
    return work


def plain_direction(work, kept):
    """Computes the direction after J. Nocedal 1980, in double precision except for the matrix between the
    loops.
    """
    way, shares, room = -work.now.astype(np.float64), {}, len(work.steps)
    pairs = [k % room for k in range(max(0, kept - room), kept)]
    for m in reversed(pairs):
        shares[m] = work.steps[m] @ way / work.curvatures[m]
        way -= shares[m] * work.changes[m]
    rounded = way.astype(np.float32)
    apply_preconditioner(system(), rounded)
    way = rounded.astype(np.float64)
    for m in pairs:
        way += (shares[m] - work.changes[m] @ way / work.curvatures[m]) * work.steps[m]
    return way, work.now @ way


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), kept=st.integers(0, 13))
def test_a_direction_is_that_of_the_plain_two_loops(seed, kept):
    """To a ten-thousandth: float32 has seven digits, and the pairs' shares multiply their rounding."""
    work = filled_buffers(len(system().inverse) // 48, seed)
    expected, slope = plain_direction(work, kept)
    direction = compute_search_direction(work.now, work, np.int64(kept), system())
    size = np.abs(expected).max()
    np.testing.assert_allclose(work.own, expected, atol=1e-4 * size)
    assert direction == pytest.approx(slope, abs=1e-4 * np.linalg.norm(expected) * np.linalg.norm(work.now))
