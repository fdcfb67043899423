"""Tests of the landmark term: its gradient and matrix belong to its energy."""

from __future__ import annotations

import numpy as np
import pytest
from bodies_for_tests import TURNS, body_of, gathered
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.fit import normal_equations, terms
from enliven_edge.tracking.fit.gauss_newton import apply_step

JOINTS = (model.JOINT_FRAMES, model.JOINT_OFFSETS)
SEEDS = st.integers(0, 10_000)
COUNTS = st.sampled_from([model.DOFS, (model.DOFS + len(model.LENGTHS))])
"""Number of unknowns with fixed and with free lengths."""
WEIGHT = 1.7
STEP = 1e-6


def random_posture(seed: int) -> Posture:
    """Returns a person at about 2.5 m with random limb rotations, arms below the shoulders."""
    dice = np.random.default_rng(seed)
    lengths = model.lengths_for_height(1.7) * dice.uniform(0.9, 1.1, 12)
    posture = Posture(np.array([0.1, 0.95, -2.5]), joint_limits.standing_pose(dice.uniform(-3, 3)), lengths)
    return moved_by(posture, np.r_[dice.normal(0, 0.05, 3), dice.normal(0, 0.3, 27), np.zeros(12)])


def moved_by(posture: Posture, step: np.ndarray) -> Posture:
    full = np.zeros(model.DOFS + len(model.LENGTHS))
    full[: len(step)] = step
    return Posture(*apply_step(posture.position, posture.rotations, posture.lengths, full, *TURNS))


def random_landmarks(posture: Posture, seed: int) -> np.ndarray:
    """Returns (20, 5) landmarks near the joints, with some outliers and some of weight 0."""
    dice = np.random.default_rng(seed)
    places = posture.joints() + dice.normal(0, 0.15, (20, 3))
    weights = dice.uniform(0, 1, 20) * (dice.random(20) < 0.8)
    return np.concatenate([places, weights[:, None], dice.uniform(0.12, 0.4, (20, 1))], 1)


def near(posture: Posture, landmarks: np.ndarray, count: int = (model.DOFS + len(model.LENGTHS))):
    """Returns (energy, gradient, upper triangle of the matrix)."""
    free = count - model.DOFS
    around = (*JOINTS, posture.lengths, body_of(posture, free), WEIGHT)
    return gathered(lambda sums: terms.near_landmarks(sums, landmarks, *around), posture, free)


def differences(of, posture: Posture, count: int) -> np.ndarray:
    """Returns the central differences of ``of(posture)`` by the unknowns, on the first axis."""
    columns = []
    for k in range(count):
        step = np.zeros(count)
        step[k] = STEP
        columns.append((of(moved_by(posture, step)) - of(moved_by(posture, -step))) / (2 * STEP))
    return np.array(columns)


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_a_carried_point_is_where_the_joint_is(seed):
    posture, point = random_posture(seed), np.empty(3)
    for j, joint in enumerate(posture.joints()):
        normal_equations.world_point_into(
            point, JOINTS[0][j], JOINTS[1][j], posture.lengths, body_of(posture)
        )
        np.testing.assert_allclose(point, joint, atol=1e-12)


@given(SEEDS, st.integers(0, 19))
@settings(max_examples=25, deadline=None)
def test_a_joint_moves_by_the_lengths_as_its_differences_say(seed, joint):
    posture, by = random_posture(seed), np.empty((3, 12))
    normal_equations.by_length(by, JOINTS[0][joint], JOINTS[1][joint], body_of(posture))
    slow = differences(lambda p: p.joints()[joint], posture, (model.DOFS + len(model.LENGTHS)))[model.DOFS :]
    np.testing.assert_allclose(by, slow.T, atol=1e-7)


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_the_energy_is_the_weighted_doubted_squares(seed):
    posture = random_posture(seed)
    landmarks = random_landmarks(posture, seed + 1)
    square = ((posture.joints() - landmarks[:, :3]) ** 2).sum(1)
    costs = landmarks[:, 3] * square / (1 + square / landmarks[:, 4] ** 2)
    assert near(posture, landmarks)[0] == pytest.approx(WEIGHT * costs.sum())


@given(SEEDS, COUNTS)
@settings(max_examples=15, deadline=None)
def test_the_gradient_is_half_the_energy_slope(seed, count):
    posture = random_posture(seed)
    landmarks = random_landmarks(posture, seed + 1)
    slope = differences(lambda p: near(p, landmarks)[0], posture, count)
    np.testing.assert_allclose(2 * near(posture, landmarks, count)[1], slope, rtol=1e-4, atol=1e-6)


@given(SEEDS, COUNTS)
@settings(max_examples=15, deadline=None)
def test_the_matrix_is_that_of_gauss_and_newton(seed, count):
    """The matrix sums the joints' differences, each with its weight and its robust weight."""
    posture = random_posture(seed)
    landmarks = random_landmarks(posture, seed + 1)
    square = ((posture.joints() - landmarks[:, :3]) ** 2).sum(1)
    weights = WEIGHT * landmarks[:, 3] / (1 + square / landmarks[:, 4] ** 2) ** 2
    rows = differences(lambda p: p.joints(), posture, count)
    slow = np.einsum("kja,lja,j->kl", rows, rows, weights)
    np.testing.assert_allclose(near(posture, landmarks, count)[2], np.triu(slow), atol=1e-6)


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_frozen_lengths_change_nothing_else(seed):
    posture = random_posture(seed)
    landmarks = random_landmarks(posture, seed + 1)
    frozen, free = near(posture, landmarks, model.DOFS), near(posture, landmarks)
    assert frozen[0] == free[0]
    np.testing.assert_allclose(frozen[1], free[1][: model.DOFS], atol=1e-12)
    np.testing.assert_allclose(frozen[2], free[2][: model.DOFS, : model.DOFS], atol=1e-12)


def test_landmarks_where_the_joints_are_pull_at_nothing_and_none_cost_nothing():
    posture = random_posture(1)
    there = random_landmarks(posture, 2)
    there[:, :3] = posture.joints()
    energy, gradient, matrix = near(posture, there)
    assert energy == pytest.approx(0.0) and np.abs(gradient).max() < 1e-9
    assert np.trace(matrix) > 0, "but it holds the person there"
    for none in (np.zeros((0, 5)), there * [1, 1, 1, 0, 1]):
        energy, gradient, matrix = near(random_posture(3), none)
        assert energy == 0.0 and not gradient.any() and not matrix.any()
