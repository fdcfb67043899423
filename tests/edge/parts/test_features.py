"""Depth differences and the walk down the trees, against slow ones that say what they do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven_edge.parts.features import CLIP, OFF, millimetres, random_features, response
from enliven_edge.parts.forest import PartForest, Trees
from enliven_edge.parts.labels import PARTS

FOCAL = (180.0, 175.0)


def person(seed: int, shape: tuple[int, int] = (40, 30)) -> np.ndarray:
    """A blob of depth with holes, in whole millimetres."""
    dice = np.random.default_rng(seed)
    v, u = np.mgrid[: shape[0], : shape[1]]
    inside = ((v - 20) / 18) ** 2 + ((u - 15) / 11) ** 2 < 1
    z = 2.0 + 0.3 * np.sin(u / 5) + 0.01 * dice.normal(size=shape)
    return np.where(inside & (dice.random(shape) > 0.1), np.round(z, 3), 0.0)


def slow_response(z: np.ndarray, row: int, column: int, feature: np.ndarray) -> float:
    """Equation 1 of Shotton et al. 2011, with the person cut out of the world."""

    def behind(right: float, below: float) -> float:
        here = z[row, column]
        v = int(np.floor(row + below * FOCAL[1] / here + 0.5))
        u = int(np.floor(column + right * FOCAL[0] / here + 0.5))
        if not (0 <= v < z.shape[0] and 0 <= u < z.shape[1]) or z[v, u] == 0:
            return OFF
        return float(np.clip(z[v, u] - here, -CLIP, CLIP))

    return behind(*feature[:2]) - behind(*feature[2:])


def fast_response(z: np.ndarray, row: int, column: int, feature: np.ndarray) -> float:
    bordered = millimetres(z)
    here = np.float32(z[row, column])
    return response(
        bordered.ravel(), 0, *bordered.shape, row + 1, column + 1, here, np.float32(FOCAL[0]) / here,
        np.float32(FOCAL[1]) / here, feature,
    )  # fmt: skip


def test_the_compiled_response_is_the_slow_one():
    z = person(0)
    rows, columns = np.nonzero(z)
    dice = np.random.default_rng(1)
    features = random_features(400, dice)
    slow, fast = [], []
    for feature in features:
        i = int(dice.integers(len(rows)))
        slow.append(slow_response(z, rows[i], columns[i], feature))
        fast.append(fast_response(z, rows[i], columns[i], feature))
    # Where an offset ends within a rounding of a pixel's border, single precision may take the neighbour.
    same = np.abs(np.array(slow) - fast) < 1e-4
    assert same.mean() > 0.99
    assert np.ptp(slow) > 0.5


@given(st.integers(0, 50), st.floats(0.5, 2.0))
@settings(max_examples=30, deadline=None)
def test_a_response_does_not_change_with_the_distance(seed, factor):
    """A person of the same size twice as far: the same pixels at twice the focal length say the same."""
    z = person(seed)
    rows, columns = np.nonzero(z)
    feature = random_features(1, np.random.default_rng(seed))[0]
    i = seed % len(rows)
    bordered = millimetres(z)
    there = (rows[i] + 1, columns[i] + 1)
    here = np.float32(z[rows[i], columns[i]])
    spans = (np.float32(FOCAL[0]) / here, np.float32(FOCAL[1]) / here)
    near = response(bordered.ravel(), 0, *bordered.shape, *there, here, *spans, feature)
    farther = np.float32(here + factor)
    moved = np.where(bordered > 0, bordered + np.uint16(round(factor * 1000)), 0).astype(np.uint16)
    far = response(moved.ravel(), 0, *moved.shape, *there, farther, *spans, feature)
    assert far == pytest.approx(near, abs=2e-3)


def stump(features: np.ndarray, threshold: float) -> PartForest:
    """One question, two leaves: surely a head, surely a left hand."""
    posterior = np.zeros((2, PARTS), np.uint8)
    posterior[0, 0], posterior[1, 9] = 255, 255
    trees = Trees(
        np.zeros(1, np.int32), np.zeros(3, np.uint16), np.full(3, threshold, np.float32),
        np.array([1, -1, -2], np.int32), posterior, np.full((2, 8), 32, np.uint8),
    )  # fmt: skip
    return PartForest(features, trees)


def test_a_walk_ends_where_the_question_sends_it():
    z = person(2)
    rows, columns = np.nonzero(z)
    features = random_features(1, np.random.default_rng(3))
    found = stump(features, 0.05).probabilities(z, np.array([*FOCAL, 0, 0]), rows, columns)
    for i in range(0, len(rows), 7):
        left = fast_response(z, rows[i], columns[i], features[0]) < np.float32(0.05)
        assert found[i, 0 if left else 9] == 1.0
    np.testing.assert_allclose(found.sum(1), 1.0)


def test_two_trees_are_asked_alike():
    z = person(4)
    rows, columns = np.nonzero(z)
    features = random_features(1, np.random.default_rng(5))
    always, never = stump(features, 9.0).trees, stump(features, -9.0).trees
    both = PartForest(features, Trees.joined([always, never]))
    found = both.probabilities(z, np.array([*FOCAL, 0, 0]), rows, columns)
    np.testing.assert_allclose(found[:, [0, 9]], 0.5)


def test_a_pixel_off_the_person_has_no_part():
    z = person(6)
    rows, columns = np.nonzero(z == 0)
    forest = stump(random_features(1, np.random.default_rng(7)), 0.0)
    assert not forest.probabilities(z, np.array([*FOCAL, 0, 0]), rows, columns).any()


def test_a_person_upside_down_is_the_same_person():
    """Turned by half a turn about the optical axis, with square pixels."""
    z = person(8)
    rows, columns = np.nonzero(z)
    dice = np.random.default_rng(9)
    camera = np.array([180.0, 180.0, 0.0, 0.0])
    agree = []
    for _ in range(20):
        forest = stump(random_features(1, dice), dice.normal(0, 0.2))
        upright = forest.probabilities(z, camera, rows, columns)
        turned = forest.probabilities(
            z[::-1, ::-1], camera, z.shape[0] - 1 - rows, z.shape[1] - 1 - columns, roll=np.pi
        )
        agree.append((upright == turned).all(1).mean())
    assert np.mean(agree) > 0.97
