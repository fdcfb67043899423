"""Tests of masks against NumPy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.masks import pixels_of


@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.1, 0.9, 1.0]))
@settings(max_examples=30, deadline=None)
def test_the_pixels_of_a_mask_in_reading_order(seed, share):
    random = np.random.default_rng(seed)
    mask = random.random(random.integers(0, 40, 2)) < share
    np.testing.assert_array_equal(pixels_of(mask), np.flatnonzero(mask))


@pytest.mark.parametrize("turned", [lambda m: m.T, lambda m: m[::-1], lambda m: m[:, ::2]])
def test_however_the_mask_lies_in_memory(turned):
    mask = turned(np.random.default_rng(0).random((30, 40)) < 0.3)
    np.testing.assert_array_equal(pixels_of(mask), np.flatnonzero(mask))
