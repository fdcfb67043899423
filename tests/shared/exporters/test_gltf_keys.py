"""Tests that omitted keys can be restored by interpolation."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.exporters.gltf.keys import reduce_keys
from enliven.rotation import from_rotation_vector, multiply, slerp

laws = settings(deadline=None, max_examples=25)
SEEDS = st.integers(0, 2**31)


@laws
@given(SEEDS, st.floats(1e-4, 0.5))
def test_omitted_keys_are_within_the_tolerance(seed, tolerance):
    rng = np.random.default_rng(seed)
    values = np.cumsum(np.cumsum(0.01 * rng.normal(size=(80, 3)), 0), 0)
    keys = reduce_keys(values, tolerance)
    assert keys[0] == 0 and keys[-1] == 79 and (np.diff(keys) > 0).all()
    shown = np.stack([np.interp(np.arange(80), keys, values[keys, c]) for c in range(3)], 1)
    assert np.linalg.norm(shown - values, axis=1).max() <= tolerance * (1 + 1e-9)


@laws
@given(SEEDS, st.floats(1e-3, 0.5))
def test_turns_too(seed, tolerance):
    rng = np.random.default_rng(seed)
    turns = from_rotation_vector(np.cumsum(0.1 * rng.normal(size=(60, 3)), 0))
    signs = np.sign((turns[1:] * turns[:-1]).sum(1))
    turns[1:] *= np.cumprod(signs)[:, None]
    keys = reduce_keys(turns, tolerance, turns=True)
    after = np.clip(np.searchsorted(keys, np.arange(60), side="right"), 1, len(keys) - 1)
    a, b = keys[after - 1], keys[after]
    shown = slerp(turns[a], turns[b], (np.arange(60) - a) / (b - a))
    between = multiply(shown * [1, -1, -1, -1], turns)
    # The chord that it is bounded by is a little less than the angle.
    assert (2 * np.arccos(np.clip(np.abs(between[:, 0]), 0, 1))).max() <= tolerance * 1.02 + 1e-6


def test_linear_motion_needs_two_keys_and_zero_tolerance_keeps_all():
    line = np.arange(50.0)[:, None] * [1.0, -2.0, 0.5]
    assert reduce_keys(line, 1e-6).tolist() == [0, 49]
    assert len(reduce_keys(line, 0.0)) == 50
    corner = np.abs(np.arange(21.0) - 10)[:, None]
    assert reduce_keys(corner, 1e-6).tolist() == [0, 10, 20]
