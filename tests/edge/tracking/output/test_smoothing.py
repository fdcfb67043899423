"""Tests of the One-Euro filter: it can be switched off, reduces noise at rest, and follows steady motion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.rotation import (
    conjugate,
    from_rotation_vector,
    multiply,
    normalized,
    to_matrix,
    to_rotation_vector,
)
from enliven_edge.tracking.output import smoothing
from enliven_edge.tracking.output.smoothing import OneEuro, OneEuroTurns
from enliven_edge.tracking.settings import SmoothingSettings

STEP = 33_333_333


def filtered(amount: float, values: np.ndarray) -> np.ndarray:
    one_euro = OneEuro(SmoothingSettings(amount=amount))
    return np.stack([one_euro(v, i * STEP) for i, v in enumerate(values)])


def test_zero_disables_the_filter():
    values = np.random.default_rng(0).normal(size=(20, 20, 3))
    np.testing.assert_array_equal(filtered(0.0, values), values)


@given(st.floats(0.1, 10.0))
@settings(max_examples=20, deadline=None)
def test_still_joints_are_calmer(amount):
    noise = np.random.default_rng(1).normal(0, 0.005, (90, 20, 3))
    assert filtered(amount, noise)[30:].std() < noise[30:].std()


def test_larger_amount_is_smoother():
    noise = np.random.default_rng(2).normal(0, 0.005, (90, 20, 3))
    spread = [filtered(amount, noise)[30:].std() for amount in (0.5, 1.0, 3.0, 9.0)]
    assert spread == sorted(spread, reverse=True)


@given(st.integers(0, 1000), st.floats(0.1, 10.0))
@settings(max_examples=20, deadline=None)
def test_places_are_filtered_as_in_the_paper(seed, amount):
    """Compared with the paper's formulas in whole arrays."""

    def alpha(cutoff):
        return 1.0 / (1.0 + 1.0 / (2 * np.pi * cutoff * STEP * 1e-9))

    values = np.random.default_rng(seed).normal(0, 0.1, (15, 20, 3)).cumsum(0)
    place, velocity, smoothed = values[0], np.zeros((20, 3)), [values[0]]
    for value in values[1:]:
        velocity = velocity + alpha(1.0) * ((value - place) / (STEP * 1e-9) - velocity)
        speed = np.linalg.norm(velocity, axis=1, keepdims=True)
        place = place + alpha((smoothing.REST_CUTOFF_HZ + smoothing.CUTOFF_PER_SPEED * speed) / amount) * (
            value - place
        )
        smoothed.append(place)
    np.testing.assert_allclose(filtered(amount, values), smoothed, atol=1e-9)


def test_steady_motion_is_followed_within_a_centimetre_or_two():
    walk = np.arange(60)[:, None, None] * np.array([0.05, 0, 0]) + np.zeros((60, 20, 3))
    assert np.abs(filtered(1.0, walk)[30:] - walk[30:]).max() < 0.03


@given(st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_smoothing_is_independent_of_world_axes(seed):
    random = np.random.default_rng(seed)
    values = random.normal(size=(10, 20, 3)).cumsum(0) * 0.02
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    np.testing.assert_allclose(filtered(1.0, values @ turn), filtered(1.0, values) @ turn, atol=1e-9)


@pytest.mark.parametrize("gap", [0, -STEP, 10_000_000_000])
def test_clock_jump_resets_the_filter(gap):
    one_euro = OneEuro(SmoothingSettings())
    one_euro(np.zeros((20, 3)), 10 * STEP)
    np.testing.assert_array_equal(one_euro(np.ones((20, 3)), 10 * STEP + gap), np.ones((20, 3)))


def turned(amount: float, values: np.ndarray) -> np.ndarray:
    one_euro = OneEuroTurns(SmoothingSettings(amount=amount))
    return np.stack([one_euro(v, i * STEP) for i, v in enumerate(values)])


def tumbling(seed: int, frames: int = 20) -> np.ndarray:
    """Returns (F, 20, 4) orientations of bones that rotate by a few degrees per frame."""
    random = np.random.default_rng(seed)
    turns = [normalized(random.normal(size=(20, 4)))]
    for _ in range(frames - 1):
        turns.append(multiply(turns[-1], from_rotation_vector(random.normal(0, 0.06, (20, 3)))))
    return np.stack(turns)


def test_zero_disables_the_filter_for_rotations():
    values = tumbling(0)
    np.testing.assert_array_equal(turned(0.0, values), values)


def test_filter_switched_on_again_starts_from_current_values():
    """State from before it was switched off must not be used."""
    one_euro = OneEuro(SmoothingSettings(amount=1.0))
    one_euro(np.zeros((20, 3)), 0)
    one_euro.amount = 0.0
    one_euro(np.ones((20, 3)), STEP)
    one_euro.amount = 1.0
    np.testing.assert_array_equal(one_euro(np.full((20, 3), 2.0), 2 * STEP), np.full((20, 3), 2.0))


@given(st.integers(0, 1000), st.integers(0, 1000), st.floats(0.1, 10.0))
@settings(max_examples=25, deadline=None)
def test_turns_are_filtered_alike_in_every_world(seed, other, amount):
    values, whole = tumbling(seed), normalized(np.random.default_rng(other).normal(size=4))
    np.testing.assert_allclose(
        to_matrix(turned(amount, multiply(whole, values))),
        to_matrix(multiply(whole, turned(amount, values))),
        atol=1e-9,
    )


@given(st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_the_sign_of_a_quaternion_means_nothing(seed):
    values = tumbling(seed)
    flips = np.random.default_rng(seed).choice([-1.0, 1.0], (len(values), 20, 1))
    np.testing.assert_allclose(
        to_matrix(turned(1.0, values * flips)), to_matrix(turned(1.0, values)), atol=1e-9
    )


def test_a_step_of_the_filter_is_that_of_the_plain_formulas():
    """Compared with a slow version that uses the library's rotations."""
    values, amount = tumbling(3), 2.0
    seconds = STEP * 1e-9
    state, velocity = values[0], np.zeros((20, 3))
    expected = [state]
    for raw in values[1:]:
        step = to_rotation_vector(multiply(conjugate(state), raw))
        velocity = velocity + (step / seconds - velocity) / (1 + 1 / (2 * np.pi * 1.0 * seconds))
        speed = np.linalg.norm(velocity, axis=1, keepdims=True)
        cutoff = (smoothing.REST_CUTOFF_HZ + smoothing.CUTOFF_PER_TURN * speed) / amount
        state = multiply(state, from_rotation_vector(step / (1 + 1 / (2 * np.pi * cutoff * seconds))))
        expected.append(state)
    np.testing.assert_allclose(to_matrix(turned(amount, values)), to_matrix(np.stack(expected)), atol=1e-9)


def test_still_bones_turn_less_and_steady_turns_are_followed():
    random = np.random.default_rng(5)
    noise = from_rotation_vector(random.normal(0, 0.03, (90, 20, 3)))
    away = [np.linalg.norm(to_rotation_vector(q), axis=-1)[30:].mean() for q in (turned(1.0, noise), noise)]
    assert away[0] < 0.6 * away[1]
    spin = from_rotation_vector(
        np.arange(60)[:, None, None] * np.array([0.0, 0.1, 0.0]) * np.ones((60, 20, 1))
    )
    late = to_rotation_vector(multiply(conjugate(turned(1.0, spin)), spin))
    assert np.linalg.norm(late, axis=-1)[30:].max() < 0.12


@pytest.mark.parametrize("gap", [0, -STEP, 10_000_000_000])
def test_a_clock_that_jumps_resets_the_turns(gap):
    one_euro, values = OneEuroTurns(SmoothingSettings()), tumbling(1)
    one_euro(values[0], 10 * STEP)
    np.testing.assert_array_equal(one_euro(values[9], 10 * STEP + gap), values[9])
