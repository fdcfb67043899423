"""Tests of fitting similarity transforms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from enliven.similarity import Similarity, fit_similarity

SEEDS = st.integers(0, 2**32 - 1)


def points_of(random: np.random.Generator, dimensions: int) -> np.ndarray:
    """Returns (20, 3) metres, away from the origin, that span a line, a plane or space."""
    return random.normal(size=(20, dimensions)) @ random.normal(size=(dimensions, 3)) + 5.0 * random.normal(
        size=3
    )


def similarity_of(random: np.random.Generator) -> Similarity:
    turn = Rotation.random(random_state=random.integers(2**31)).as_matrix()
    return Similarity(float(10.0 ** random.uniform(-2, 2)), turn, random.normal(size=3))


@pytest.mark.parametrize("dimensions", [2, 3])
@given(seed=SEEDS)
def test_similarity_of_a_flat_or_solid_mesh_is_recovered(dimensions: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    source, true, others = points_of(random, dimensions), similarity_of(random), random.normal(size=(7, 3))
    fit = fit_similarity(source, true.transform(source))
    # Other points as well: an affine map of a flat mesh would press them into its plane.
    scale = true.size * (1.0 + np.abs(others).max() + np.abs(source).max())
    np.testing.assert_allclose(fit.transform(others), true.transform(others), atol=1e-6 * scale)
    np.testing.assert_allclose(
        fit.transform_back(fit.transform(others)), others, atol=1e-6 * scale / true.size
    )


@given(seed=SEEDS)
def test_rotation_of_noisy_points_equals_that_of_scipy(seed: int) -> None:
    random = np.random.default_rng(seed)
    source = points_of(random, 3)
    target = similarity_of(random).transform(source) + random.normal(size=source.shape)
    fit = fit_similarity(source, target)
    centred = source - source.mean(0), target - target.mean(0)
    expected, _ = Rotation.align_vectors(centred[1], centred[0])
    error = [
        np.linalg.norm(centred[1] - fit.size * centred[0] @ turn.T)
        for turn in (fit.turn, expected.as_matrix())
    ]
    # Two rotations may be equally good, so errors are compared.
    assert error[0] <= error[1] * (1.0 + 1e-9)
    assert np.linalg.det(fit.turn) == pytest.approx(1.0)


@pytest.mark.parametrize("points", [np.zeros((4, 3)), np.outer(np.arange(4.0), [1.0, 2.0, 3.0])])
def test_points_without_extent_in_space_give_a_rotation(points: np.ndarray) -> None:
    fit = fit_similarity(points, 2.0 * points + 1.0)
    np.testing.assert_allclose(fit.turn @ fit.turn.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(fit.transform(points), 2.0 * points + 1.0, atol=1e-9)
