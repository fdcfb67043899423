"""Tests of the visible length of bones, and of viewing directions that show more of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.errors import InputError
from enliven.matching.views import ScreenView, compute_projected_length, find_best_view, is_end_on

seeds = st.integers(0, 2**32 - 1)


@given(seeds)
@settings(max_examples=50, deadline=None)
def test_axes_are_a_right_handed_screen(seed):
    rng = np.random.default_rng(seed)
    view = ScreenView(5.0 * rng.normal(size=3), rng.normal(size=3))
    right, up = view.axes
    np.testing.assert_allclose(
        np.stack([right, up, -view.direction]) @ np.stack([right, up, -view.direction]).T,
        np.eye(3),
        atol=1e-12,
    )
    np.testing.assert_allclose(np.cross(right, up), -view.direction, atol=1e-12)


def test_the_default_view_looks_along_minus_z():
    np.testing.assert_allclose(ScreenView().project(np.array([1.0, 2.0, 3.0])), [1.0, 2.0])


def test_from_behind_left_and_right_change_as_in_a_mirror():
    behind = ScreenView(np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(behind.project(np.array([1.0, 2.0, 3.0])), [-1.0, 2.0])


def test_a_perspective_view_divides_by_the_depth():
    view = ScreenView(eye=np.array([0.0, 0.0, 4.0]))
    np.testing.assert_allclose(
        view.project(np.array([[1.0, 2.0, 2.0], [1.0, 0.0, 5.0]])), [[0.5, 1.0], [1e3, 0.0]]
    )


@pytest.mark.parametrize("direction", [np.zeros(3), np.array([0.0, 2.0, 0.0]), np.array([np.nan, 0.0, 1.0])])
def test_a_view_without_a_direction_is_refused(direction):
    with pytest.raises(InputError, match="direction"):
        ScreenView(direction)


def test_foreshortened_bones_are_reported():
    vectors = np.array([[0.0, 0.0, 1.0], [0.1, 0.0, 1.0], [0.0, 0.5, 1.0], [0.0, 0.0, 0.0]])
    assert is_end_on(vectors, ScreenView()).tolist() == [True, True, False, False]
    assert is_end_on(vectors, ScreenView(), 0.05).tolist() == [True, False, False, False]


@pytest.mark.slow
@given(seeds, st.integers(1, 12))
@settings(max_examples=40, deadline=None)
def test_suggested_view_shows_most_bone_length(seed, count):
    rng = np.random.default_rng(seed)
    vectors = rng.normal(size=(count, 3)) * rng.uniform(0.1, 2.0, (count, 1))
    view = ScreenView(rng.normal(size=3), rng.normal(size=3))
    best = find_best_view(vectors, view)
    tried = rng.normal(size=(2000, 3))
    tried /= np.linalg.norm(tried, axis=1, keepdims=True)
    most = max(compute_projected_length(vectors, direction) for direction in tried)
    # The sum has several summits; the best of four climbs is never far below the highest.
    assert compute_projected_length(vectors, best.direction) >= 0.97 * most
    assert (
        compute_projected_length(vectors, best.direction)
        >= compute_projected_length(vectors, view.direction) - 1e-9
    )
    assert best.direction @ view.direction >= -1e-9, "a view from behind shows as much"


def test_a_flat_skeleton_is_seen_from_the_front():
    rng = np.random.default_rng(1)
    vectors = np.concatenate([rng.normal(size=(9, 2)), np.zeros((9, 1))], axis=1)
    best = find_best_view(vectors, ScreenView(np.array([1.0, 0.0, -0.2])))
    np.testing.assert_allclose(best.direction, [0.0, 0.0, -1.0], atol=1e-6)
    np.testing.assert_allclose(best.up, [0.0, 1.0, 0.0], atol=1e-6)
    assert not is_end_on(vectors, best).any()


@given(seeds, st.floats(0.05, 1.2))
@settings(max_examples=40, deadline=None)
def test_suggested_view_stays_near_current_view_on_request(seed, most_turn):
    rng = np.random.default_rng(seed)
    vectors, view = rng.normal(size=(5, 3)), ScreenView(rng.normal(size=3), rng.normal(size=3))
    best = find_best_view(vectors, view, most_turn)
    assert np.arccos(np.clip(best.direction @ view.direction, -1.0, 1.0)) <= most_turn + 1e-6
    assert (
        compute_projected_length(vectors, best.direction)
        >= compute_projected_length(vectors, view.direction) - 1e-9
    )


def test_a_view_from_above_keeps_an_up():
    vectors = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    best = find_best_view(vectors, ScreenView(np.array([0.0, -0.1, -1.0])))
    np.testing.assert_allclose(np.abs(best.direction), [0.0, 1.0, 0.0], atol=1e-6)
    assert abs(best.up @ best.direction) < 1e-9


def test_without_bones_the_view_stays():
    view = ScreenView()
    assert find_best_view(np.zeros((3, 3)), view) is view
