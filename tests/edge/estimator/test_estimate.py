"""Tests of an estimate: body parts are interpolated, and joints are weighted by confidence."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from people_for_estimator import scene
from scipy.ndimage import map_coordinates
from scipy.special import log_softmax, softmax

from enliven.kernels import njit
from enliven_edge.tracking.estimator.crop import COLUMNS, ROWS, crop_person
from enliven_edge.tracking.estimator.estimator import JOINT_TRUST, Estimate, decode_output
from enliven_edge.tracking.estimator.labels import PARTS
from enliven_edge.tracking.estimator.part_map import exponential
from enliven_synthesis.training.samples import LABEL_COLUMNS, LABEL_ROWS

SEEDS = st.integers(0, 100_000)


def made_up(seed: int) -> Estimate:
    """Returns a random estimate."""
    dice = np.random.default_rng(seed)
    parts = dice.normal(0, 3, (PARTS, LABEL_ROWS, LABEL_COLUMNS)).astype(np.float32)
    crop = crop_person(*scene(seed))
    return Estimate(dice.normal(size=(20, 3)), dice.uniform(0.01, 0.6, 20), np.zeros(8), parts, crop)


def rays_of(estimate: Estimate, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Returns (N, 2) rays to positions in the crop, given in cells from its upper left corner."""
    cell = estimate.crop.cell
    flat = np.stack([(columns - COLUMNS / 2) * cell, (rows - ROWS / 2) * cell, 0.0 * rows], 1)
    points = estimate.crop.to_camera(flat)
    return points[:, :2] / points[:, 2:]


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_parts_at_a_ray_are_those_of_the_slow_look_up(seed):
    """Linear between cell centres; constant beyond the outermost ones."""
    estimate, dice = made_up(seed), np.random.default_rng(seed)
    columns, rows = dice.uniform(-20, COLUMNS + 20, 60), dice.uniform(-20, ROWS + 20, 60)
    logits = np.stack(
        [
            map_coordinates(m, [rows / 2 - 0.5, columns / 2 - 0.5], order=1, mode="nearest")
            for m in estimate.parts
        ]
    )
    expected = np.exp(logits) / np.exp(logits).sum(0)
    shares = estimate.parts_at(rays_of(estimate, columns, rows))
    np.testing.assert_allclose(shares, expected, atol=5e-3)
    np.testing.assert_allclose(shares.sum(0), 1.0, atol=1e-5)


@given(st.floats(-120.0, 80.0, width=32))
@settings(max_examples=300, deadline=None)
def test_the_exponential_is_the_exponential(x):
    """To a few units in the last place of single precision; nearly 0 below its range."""
    slow = np.exp(np.float64(max(x, -87.0)))
    assert powered(np.float32(x)) == pytest.approx(slow, rel=4e-7)


@njit(nogil=True)
def powered(x):
    return exponential(x)


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_parts_in_the_middle_of_a_cell_are_that_cells(seed):
    estimate, dice = made_up(seed), np.random.default_rng(seed)
    column, row = dice.integers(1, LABEL_COLUMNS - 1, 20), dice.integers(1, LABEL_ROWS - 1, 20)
    shares = estimate.parts_at(rays_of(estimate, 2 * column + 1.0, 2 * row + 1.0))
    assert np.array_equal(shares.argmax(0), estimate.parts[:, row, column].argmax(0))


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_the_surer_a_joint_the_more_it_weighs(seed):
    estimate = made_up(seed)
    landmarks = estimate.landmarks
    order = np.argsort(estimate.expected_errors)
    assert landmarks.shape == (20, 5)
    assert np.array_equal(landmarks[:, :3], estimate.joints)
    weight = landmarks[:, 3] / JOINT_TRUST
    assert (np.diff(weight[order]) <= 0).all() and (weight > 0).all()
    assert (np.diff(landmarks[order, 4]) >= 0).all(), "and the nearer it must be to be believed"
    assert landmarks[:, 4].min() >= 0.12 and landmarks[:, 4].max() <= 0.4


def test_joints_of_usual_confidence_have_total_weight_one():
    estimate = dataclasses.replace(made_up(0), expected_errors=np.full(20, 0.05))
    assert estimate.landmarks[:, 3].sum() == pytest.approx(JOINT_TRUST.mean())
    assert JOINT_TRUST[12:].max() < JOINT_TRUST[:12].min(), "legs weigh less than trunk and arms"


@pytest.mark.parametrize("spread", [0.01, 0.03, 0.05, 0.2])
def test_guide_weights_are_capped_at_the_usual_confidence(spread):
    estimate = dataclasses.replace(made_up(0), expected_errors=np.full(20, spread))
    capped = dataclasses.replace(estimate, expected_errors=np.full(20, max(spread, 0.05)))
    np.testing.assert_allclose(estimate.weak_landmarks, capped.landmarks)
    np.testing.assert_array_equal(estimate.weak_landmarks[:, :3], estimate.landmarks[:, :3])
    assert (estimate.weak_landmarks[:, 3] <= estimate.landmarks[:, 3]).all()


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_network_output_is_decoded_as_in_training(seed):
    """Positions are transformed to the world; spreads and probabilities come from their logarithms."""
    dice = np.random.default_rng(seed)
    here, spread = dice.normal(size=(20, 3)), dice.normal(-3, 2, 20).astype(np.float32)
    facing, pose = dice.normal(0, 4, 9).astype(np.float32), np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.linalg.qr(dice.normal(size=(3, 3)))[0], dice.normal(size=3)
    world, off, ways, somebody = decode_output(here, spread, facing, pose)
    np.testing.assert_allclose(world, here @ pose[:3, :3].T + pose[:3, 3], atol=1e-12)
    np.testing.assert_allclose(off, np.minimum(1.0, 3.0 * np.exp(spread.astype(float))), rtol=1e-12)
    np.testing.assert_allclose(ways, log_softmax(facing[:8].astype(float)), atol=1e-12)
    assert somebody == pytest.approx(softmax(facing.astype(float))[:8].sum(), abs=1e-12)


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_a_landmark_is_weighed_by_its_spread(seed):
    estimate = made_up(seed)
    sure = np.maximum(estimate.expected_errors, 0.03)
    columns = [JOINT_TRUST * (0.05 / sure) ** 2 / 20, np.clip(3.0 * sure, 0.12, 0.4)]
    np.testing.assert_allclose(estimate.landmarks, np.c_[estimate.joints, np.transpose(columns)], atol=1e-12)


@given(SEEDS, st.integers(0, 19))
@settings(max_examples=25, deadline=None)
def test_joint_counts_as_apart_beyond_its_expected_error(seed, joint):
    estimate = made_up(seed)
    assert estimate.count_disagreeing(estimate.joints) == 0
    way = np.random.default_rng(seed).normal(size=3)
    way /= np.linalg.norm(way)
    for metres, elsewhere in ((0.07, False), (1.4 * estimate.expected_errors[joint], False), (1.0, True)):
        moved = estimate.joints.copy()
        moved[joint] += metres * way
        assert estimate.count_disagreeing(moved) == int(elsewhere)
