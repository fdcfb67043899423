"""Tests of trajectories from examples: their invariants, and a slow dense solution of the spacetime
problem.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from enliven.document.constraints import Coupling, Position, Velocity
from enliven.document.example_settings import ExampleSettings
from enliven.errors import InputError
from enliven.examples.mapping import ExampleMap
from enliven.examples.performer import convert_to_body_frame
from enliven.examples.poses import Examples
from enliven.examples.spacetime.banded import apply_transposed_differences, compute_accelerations
from enliven.examples.spacetime.constraints import convert_constraints
from enliven.skeletons.facing import rotate_about_y

STEP = 1 / 30
FEW = settings(max_examples=25, deadline=None)
SEEDS = st.integers(0, 10**6)


def examples_of(seed, count=5, pairs=3):
    rng = np.random.default_rng(seed)
    names = tuple(f"p{i}" for i in range(pairs))
    return Examples(
        names, names, rng.normal(size=(count, pairs, 3)), 2.0 * rng.normal(size=(count, pairs, 3))
    )


def motion_of(examples, frames, seed):
    """Returns poses that move randomly between the examples."""
    rng = np.random.default_rng(seed)
    knots = rng.integers(0, len(examples), frames // 6 + 2)
    at = np.linspace(0, len(knots) - 1.001, frames)
    low, part = at.astype(int), (at % 1)[:, None, None]
    poses = examples.sources[knots[low]] * (1 - part) + examples.sources[knots[low + 1]] * part
    return poses + 0.05 * rng.normal(size=poses.shape)


@given(SEEDS, st.integers(2, 9), st.integers(1, 6))
@FEW
def test_an_example_is_met_exactly_without_the_acceleration_term(seed, count, nearest):
    examples = examples_of(seed, count)
    mapping = ExampleMap(examples, ExampleSettings(acceleration=0.0, nearest=nearest))
    poses = motion_of(examples, 20, seed)
    poses[[3, 11]] = examples.sources[[0, count - 1]]
    places = mapping.solve(poses, STEP)
    np.testing.assert_allclose(places[[3, 11]], examples.targets[[0, count - 1]], atol=1e-9)


@given(SEEDS, st.floats(-7, 7), st.lists(st.floats(-50, 50), min_size=3, max_size=3))
@FEW
def test_result_is_independent_of_performer_position_and_heading(seed, angle, moved):
    examples = examples_of(seed)
    rng = np.random.default_rng(seed)
    world, root, yaw = rng.normal(size=(12, 3, 3)), rng.normal(size=(12, 3)), rng.normal(size=12)
    there = rotate_about_y(world, np.array(angle)) + moved, rotate_about_y(root, np.array(angle)) + moved
    mapping = ExampleMap(examples)
    here = mapping.solve(convert_to_body_frame(world, root, yaw), STEP)
    np.testing.assert_allclose(
        mapping.solve(convert_to_body_frame(*there, yaw + angle), STEP), here, atol=1e-7
    )


@given(SEEDS, st.lists(st.floats(-50, 50), min_size=3, max_size=3))
@FEW
def test_poses_and_examples_moved_together_give_the_same(seed, moved):
    examples = examples_of(seed)
    poses = motion_of(examples, 15, seed)
    shifted = Examples(examples.joints, examples.points, examples.sources, examples.targets + moved)
    at_home = ExampleMap(examples).solve(poses, STEP)
    np.testing.assert_allclose(ExampleMap(shifted).solve(poses, STEP), at_home + moved, atol=1e-7)


def dense(mapping, poses, constraints, weight):
    """Solves all weights and the deviations from the examples as one bounded least-squares problem.

    Hard constraints are rows with a large weight, which makes the solution exact to about 1e-6.
    """
    nodes, examples = mapping.compute_nodes(poses), mapping.examples
    points, frames, most = nodes.right.shape
    each = most + 3
    unknowns = points * frames * each
    place = np.zeros((points, frames, 3, unknowns))
    rows, right = [], []
    for p in range(points):
        for f in range(frames):
            at = (p * frames + f) * each
            place[p, f, :, at : at + most] = nodes.reach[p, f].T
            place[p, f, :, at + most : at + each] = np.eye(3)
            root = np.linalg.cholesky(nodes.matrix[p, f]).T
            row = np.zeros((each, unknowns))
            row[:most, at : at + most] = root
            row[most:, at + most : at + each] = np.eye(3) / np.sqrt(nodes.slack[p, f])
            rows.append(row)
            right.append(np.concatenate([np.linalg.solve(root.T, nodes.right[p, f]), np.zeros(3)]))
    for f in range(1, frames - 1):
        for p in range(points):
            rows.append(weight * (place[p, f - 1] - 2 * place[p, f] + place[p, f + 1]))
            right.append(np.zeros(3))
    middle, size = examples.targets.mean(0), examples.target_size
    for constraint in constraints:
        p, f = examples.find_point(constraint.point), constraint.frame
        for axis in map("xyz".index, constraint.axes):
            if isinstance(constraint, Position):
                row, value = place[p, f, axis], constraint.place[axis] - middle[p, axis]
            elif isinstance(constraint, Velocity):
                row, value = place[p, f, axis] - place[p, f - 1, axis], constraint.velocity[axis] * STEP
            else:
                o = examples.find_point(constraint.other)
                row = place[p, f, axis] - place[o, f, axis]
                value = constraint.apart[axis] - middle[p, axis] + middle[o, axis]
            rows.append(1e4 * row[None])
            right.append([1e4 * value / size])
    low = np.tile([*[-mapping.settings.margin] * most, *[-np.inf] * 3], points * frames)
    high = np.tile([*[1 + mapping.settings.margin] * most, *[np.inf] * 3], points * frames)
    solution = lsq_linear(np.vstack(rows), np.concatenate(right), (low, high), method="bvls", tol=1e-14)
    return np.moveaxis(place @ solution.x, 0, 1) * size + middle


@given(SEEDS, st.sampled_from([0.0, 0.05, 0.25, 100.0]), st.sampled_from([0.05, 0.3, 3.0]), st.booleans())
@settings(max_examples=20, deadline=None)
def test_banded_solution_matches_dense_reference(seed, margin, weight, constrained):
    examples = examples_of(seed, 5, 2)
    poses = motion_of(examples, 9, seed)
    mapping = ExampleMap(examples, ExampleSettings(margin=margin, acceleration=weight))
    constraints = []
    if constrained:
        constraints = [
            Position("p0", 2, (1.0, 0.5, -0.3)),
            Position("p1", 6, (0.0, 0.7, 0.0), axes="y"),
            Velocity("p1", 4, (0.1, -0.4, 0.0), axes="xy"),
            Coupling("p0", "p1", 8),
        ]
    ours = mapping.solve(poses, STEP, constraints)
    np.testing.assert_allclose(ours, dense(mapping, poses, constraints, weight), atol=2e-5)


@pytest.mark.slow
@given(
    SEEDS,
    st.sampled_from([0.0, 0.05, 0.25, 1.0]),
    st.sampled_from([0.01, 0.3, 3.0]),
    st.integers(1, 9),
    st.sampled_from([0.01, 0.1]),
    st.sampled_from([0.03, 1.0]),
    st.sampled_from([0.0, 0.3, 2.0]),
)
@settings(max_examples=40, deadline=None)
def test_long_motions_are_solved_to_the_end(seed, margin, weight, nearest, far, slack, noise):
    """Each control point is at the frame's optimum for the pull of the accelerations."""
    how = ExampleSettings(margin=margin, acceleration=weight, nearest=nearest, far=far, slack=slack)
    mapping = ExampleMap(examples_of(seed, 8, 2), how)
    poses = motion_of(mapping.examples, 240, seed)
    poses += noise * np.random.default_rng(seed).normal(size=poses.shape)
    places = mapping.solve_checked_poses(
        poses, convert_constraints((), mapping.examples, 240, STEP), STEP
    ).places
    pull = weight**2 * apply_transposed_differences(compute_accelerations(places), 240)
    best = np.empty_like(places)
    mapping.compute_nodes(poses).solve_for_pull(pull, -margin, 1.0 + margin, best)
    np.testing.assert_allclose(best, places, atol=1e-6 * np.abs(places).max())


@given(SEEDS)
@FEW
def test_hard_constraints_are_met(seed):
    examples = examples_of(seed)
    rng = np.random.default_rng(seed)
    a, b, v = (tuple(rng.normal(size=3)) for _ in range(3))
    constraints = [
        Position("p0", 4, a),
        Position("p1", 0, b, axes="xz"),
        Velocity("p0", 5, v),
        *(Velocity("p2", f, (0.0, 0.0, 0.0)) for f in range(10, 16)),
        Coupling("p0", "p2", 20, apart=(0.0, 0.1, 0.0)),
        Coupling("p1", "p2", 12, axes="xyz"),
    ]
    places = ExampleMap(examples).solve(motion_of(examples, 30, seed), STEP, constraints)
    np.testing.assert_allclose(places[4, 0], a, atol=1e-9)
    np.testing.assert_allclose(places[0, 1, [0, 2]], [b[0], b[2]], atol=1e-9)
    np.testing.assert_allclose(places[5, 0] - places[4, 0], np.array(v) * STEP, atol=1e-9)
    np.testing.assert_allclose(np.diff(places[9:16, 2], axis=0), 0.0, atol=1e-9)
    np.testing.assert_allclose(places[20, 0, 1] - places[20, 2, 1], 0.1, atol=1e-9)
    np.testing.assert_allclose(places[12, 1], places[12, 2], atol=1e-9)


def test_the_work_grows_as_the_frames_do():
    examples = examples_of(3)
    mapping = ExampleMap(examples)
    works = []
    for frames in (200, 400, 800):
        poses = np.tile(motion_of(examples, 200, 1), (frames // 200, 1, 1))
        works.append(
            mapping.solve_checked_poses(poses, convert_constraints((), examples, frames, STEP), STEP).work
        )
    assert works[1] < 2.2 * works[0]
    assert works[2] < 2.2 * works[1]


def refused(job, *words):
    with pytest.raises(InputError) as error:
        job()
    for word in words:
        assert word in str(error.value)


def test_bad_examples_are_refused_by_name():
    good = examples_of(1)
    refused(
        lambda: Examples(good.joints, good.points, good.sources[:1], good.targets[:1]),
        "number of examples is 1",
    )
    twice = good.sources.copy()
    twice[3] = twice[1]
    refused(lambda: Examples(good.joints, good.points, twice, good.targets), "1 and 3", "same pose")
    wrong = good.targets.copy()
    wrong[2, 1, 0] = np.nan
    refused(lambda: Examples(good.joints, good.points, good.sources, wrong), "example 2", "p1")


def test_bad_frames_are_refused_by_number():
    mapping = ExampleMap(examples_of(1))
    poses = motion_of(mapping.examples, 20, 1)
    poses[[4, 17], 1] = np.nan
    refused(lambda: mapping.solve(poses, STEP), "2 frames", "4, 17")


def test_contradictory_constraints_are_named():
    mapping = ExampleMap(examples_of(1))
    poses = motion_of(mapping.examples, 20, 1)
    chain = [
        Position("p0", 3, (0.0, 0.0, 0.0)),
        Velocity("p0", 4, (0.0, 0.0, 0.0)),
        Coupling("p0", "p1", 4),
        Position("p1", 4, (0.0, 1.0, 0.0)),
    ]
    mapping.solve(poses, STEP, chain[:3])
    mapping.solve(poses, STEP, [*chain[:3], Position("p1", 4, (5.0, 0.0, 5.0))])
    words = [f"{name!r} at frame {frame}" for name, frame in (("p0", 3), ("p0", 4), ("p1", 4))]
    refused(lambda: mapping.solve(poses, STEP, chain), "contradicts", "coupling", *words)
    refused(lambda: mapping.solve(poses, STEP, [Velocity("p0", 0, (0, 0, 0))]), "velocity", "frame 0")
    refused(lambda: mapping.solve(poses, STEP, [Position("p9", 0, (0, 0, 0))]), "p9", "p0")
