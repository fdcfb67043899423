"""The One-Euro filter: off is off, still is calm, steady motion is followed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven_edge.tracking.settings import SmoothingSettings
from enliven_edge.tracking.smoothing import OneEuro

STEP = 33_333_333


def filtered(amount: float, values: np.ndarray) -> np.ndarray:
    one_euro = OneEuro(SmoothingSettings(amount=amount))
    return np.stack([one_euro(v, i * STEP) for i, v in enumerate(values)])


def test_zero_is_off():
    values = np.random.default_rng(0).normal(size=(20, 20, 3))
    np.testing.assert_array_equal(filtered(0.0, values), values)


@given(st.floats(0.1, 10.0))
@settings(max_examples=20, deadline=None)
def test_still_joints_are_calmer(amount):
    noise = np.random.default_rng(1).normal(0, 0.005, (90, 20, 3))
    assert filtered(amount, noise)[30:].std() < noise[30:].std()


def test_more_is_smoother():
    noise = np.random.default_rng(2).normal(0, 0.005, (90, 20, 3))
    spread = [filtered(amount, noise)[30:].std() for amount in (0.5, 1.0, 3.0, 9.0)]
    assert spread == sorted(spread, reverse=True)


def test_steady_motion_is_followed_within_a_centimetre_or_two():
    walk = np.arange(60)[:, None, None] * np.array([0.05, 0, 0]) + np.zeros((60, 20, 3))
    assert np.abs(filtered(1.0, walk)[30:] - walk[30:]).max() < 0.03


@given(st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_it_does_not_depend_on_the_axes_of_the_world(seed):
    random = np.random.default_rng(seed)
    values = random.normal(size=(10, 20, 3)).cumsum(0) * 0.02
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    np.testing.assert_allclose(filtered(1.0, values @ turn), filtered(1.0, values) @ turn, atol=1e-9)


@pytest.mark.parametrize("gap", [0, -STEP, 10_000_000_000])
def test_a_clock_that_jumps_resets_it(gap):
    one_euro = OneEuro(SmoothingSettings())
    one_euro(np.zeros((20, 3)), 10 * STEP)
    np.testing.assert_array_equal(one_euro(np.ones((20, 3)), 10 * STEP + gap), np.ones((20, 3)))
