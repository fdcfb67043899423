"""Tests of how close a frame comes to the energy minimum, against Gauss-Newton started from the frame's
result.
"""

from concurrent.futures import Future

import numpy as np
import pytest
from creatures import random_problem
from hypothesis import example, given, settings
from hypothesis import strategies as st
from plain_gauss_newton import PlainGaussNewton

from enliven.deformation.embedded import renewal
from enliven.deformation.embedded.solver import EmbeddedSettings, EmbeddedSolver

GAP = 0.002
"""Maximum relative excess of a frame's energy over the minimum."""
INVISIBLE = 1e-6
"""Energy below which relative differences mean nothing. One point that is off by a tenth of a millimetre has
it.
"""
BUCKLES = 880092, 19, 1.9291120993690865
"""Seed of a creature, its node count and the pace of its motion. In frame 15 a limb buckles."""
RIDGES = 40, 8, 53, 0
"""Seeds of creatures. In one frame of each, the solver ended on a ridge of the energy."""


def gap_of(peer, solver, targets):
    """Returns the relative excess over the minimum. 0 if Gauss-Newton inverts a node, which our solver never
    does.
    """
    peer.set_targets(targets)
    x, least, _ = peer.solve(peer.pack(solver.state()), lambda energy: False)
    turned = np.linalg.det(x[: 9 * len(solver.graph.positions)].reshape(-1, 3, 3)).min() < 0.05
    return 0.0 if turned else (solver.energy_terms["total"] - least - INVISIBLE) / least


@pytest.mark.slow
@settings(deadline=None, max_examples=12)
@given(st.integers(0, 2**32 - 1), st.integers(12, 48), st.floats(0.3, 2.0))
# A limb buckles in frame 15. The steps cannot predict this, and the minimum is 6 % lower.
@example(*BUCKLES)
def test_frame_is_near_minimum_or_reports_that_it_is_not(seed, nodes, pace):
    problem = random_problem(seed, nodes, 16, pace)
    solver, peer = (
        EmbeddedSolver(problem.graph, problem.points),
        PlainGaussNewton(problem.graph, problem.points),
    )
    for frame, targets in enumerate(problem.targets):
        solver.solve(targets)
        if frame % 5 == 0:
            near = gap_of(peer, solver, targets) <= GAP
            assert near or not solver.is_settled, frame


def frame_on_a_ridge():
    """Returns a creature's problem, two solvers that have ended a frame on a ridge, and that frame's targets.

    Whether a frame ends on a ridge depends on rounding (about one frame in 600). The seeds found on one
    processor are therefore tried first.
    """
    for seed in (*RIDGES, *range(300)):
        rng = np.random.default_rng(seed)
        problem = random_problem(seed, int(rng.integers(12, 49)), 16, round(rng.uniform(0.3, 2.0), 2))
        solver, unasked = (EmbeddedSolver(problem.graph, problem.points) for _ in range(2))
        for targets in problem.targets:
            solver.solve(targets)
            unasked.solve(targets)
            np.testing.assert_array_equal(solver.state()[1], unasked.state()[1])
            if not solver.is_settled:
                return problem, solver, unasked, targets
    raise AssertionError("no frame ends on a ridge")


def test_frame_on_a_ridge_is_reported_and_next_frame_leaves_it():
    """Where a limb buckles, the gradient does not reveal the lower energy. The next frame reaches it."""
    problem, solver, unasked, targets = frame_on_a_ridge()
    # The check did not change the state.
    np.testing.assert_array_equal(solver.state()[1], unasked.state()[1])
    before = solver.energy_terms["total"]
    solver.solve(targets)
    assert solver.is_settled
    assert solver.energy_terms["total"] < (1 - 0.5 * GAP) * before
    assert gap_of(PlainGaussNewton(problem.graph, problem.points), solver, targets) <= GAP


@settings(deadline=None, max_examples=6)
@given(st.integers(0, 2**32 - 1), st.integers(12, 48), st.floats(0.3, 2.0), st.sampled_from([60, 3]))
@example(*BUCKLES, 60)
def test_static_targets_converge_to_the_minimum(seed, nodes, pace, most):
    """Later frames reduce the excess that a frame left on a ridge or because of its step limit."""
    problem = random_problem(seed, nodes, 16, pace)
    solver = EmbeddedSolver(problem.graph, problem.points, EmbeddedSettings(iterations=most))
    peer = PlainGaussNewton(problem.graph, problem.points)
    for targets in problem.targets:
        solver.solve(targets)
    for _ in range(60):
        solver.solve(targets)
    assert gap_of(peer, solver, targets) <= GAP


@settings(deadline=None, max_examples=6)
@given(st.integers(0, 2**32 - 1), st.integers(2, 6))
def test_step_limit_is_reported_and_next_frames_catch_up(seed, most):
    problem = random_problem(seed, 32, 12, 2.0)
    solver = EmbeddedSolver(problem.graph, problem.points, EmbeddedSettings(iterations=most))
    peer = PlainGaussNewton(problem.graph, problem.points)
    for targets in problem.targets[:8]:
        solver.solve(targets)
        assert solver.is_settled or solver.iterations <= most
    for _ in range(60):
        solver.solve(targets)
        if solver.is_settled:
            break
    assert solver.is_settled
    assert gap_of(peer, solver, targets) <= GAP


@settings(deadline=None, max_examples=4)
@given(st.integers(0, 2**32 - 1), st.integers(12, 48))
def test_time_limit_is_reported_and_next_frames_catch_up(seed, nodes):
    """A budget far below what one step takes: each frame is one step, on any machine."""
    problem = random_problem(seed, nodes, 8, 1.0)
    solver = EmbeddedSolver(problem.graph, problem.points, EmbeddedSettings(budget_ms=1e-6))
    for targets in problem.targets:
        solver.solve(targets)
        assert solver.iterations == 1 or solver.is_settled
    before = np.inf
    for _ in range(100):
        solver.solve(targets)
        assert solver.energy_terms["total"] <= before * (1 + 1e-9)
        before = solver.energy_terms["total"]
        if solver.is_settled:
            break
    assert solver.is_settled
    peer = PlainGaussNewton(problem.graph, problem.points)
    assert gap_of(peer, solver, targets) <= GAP


def test_matrix_from_background_thread_equals_direct_one(monkeypatch):
    """Frames are bit-identical whether another thread makes the matrices or the caller waits for them."""
    problem, frames = random_problem(3, 24, 8, 1.0), []
    for beside in (True, False):
        # With a budget, the matrices come from the other thread. This budget is never exhausted.
        solver = EmbeddedSolver(problem.graph, problem.points, EmbeddedSettings(budget_ms=1000.0))
        if not beside:
            monkeypatch.setattr(renewal, "_second_thread", AtOnce)
        frames.append([solver.solve(targets)[1] for targets in problem.targets])
    np.testing.assert_array_equal(frames[0], frames[1])


class AtOnce:
    """An executor that runs the work immediately instead of in a second thread."""

    def submit(self, work, *arguments):
        """Runs the work and returns a completed future."""
        done = Future()
        done.set_result(work(*arguments))
        return done
