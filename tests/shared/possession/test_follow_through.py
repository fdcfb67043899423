"""Tests of follow-through: soft parts swing, stiff parts do not, and uniform motion has no lag."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.possession.easing.follow_through import FULL_SWING_STIFFNESS, FollowThrough, advance_oscillators

laws = settings(deadline=None, max_examples=25)
SEEDS = st.integers(0, 2**32 - 1)
FRAME = 33_333_333


def way_of(seed, frames=60, nodes=5):
    """Returns (F, N, 3) metres, positions that change smoothly."""
    rng = np.random.default_rng(seed)
    times = np.arange(frames)[:, None, None] / 30.0
    waves = sum(
        rng.normal(size=(nodes, 3)) * 0.02 * np.sin(rate * times + rng.random((nodes, 3)) * 6)
        for rate in (2.0, 5.0, 11.0)
    )
    return waves + rng.normal(size=(nodes, 3))


def shown(way, stiffness, exaggeration=1.0):
    swing = FollowThrough(None if stiffness is None else np.asarray(stiffness), exaggeration)
    return np.array([swing(places, k * FRAME) for k, places in enumerate(way)])


@laws
@given(SEEDS, st.floats(0.0, 4.0))
def test_rigid_parts_are_unchanged_bit_for_bit(seed, exaggeration):
    way = way_of(seed)
    np.testing.assert_array_equal(shown(way, None, exaggeration), way)
    np.testing.assert_array_equal(shown(way, np.geomspace(1.0, 50.0, 5), exaggeration), way)
    np.testing.assert_array_equal(shown(way, np.geomspace(0.01, 1.0, 5), 0.0), way)


@laws
@given(SEEDS)
def test_an_even_speed_is_followed_and_a_rest_is_reached(seed):
    rng = np.random.default_rng(seed)
    pace, start = rng.normal(size=(2, 5, 3))
    even = start + pace * np.arange(30)[:, None, None] / 30.0
    stiffness = np.full(5, FULL_SWING_STIFFNESS)
    np.testing.assert_allclose(shown(even, stiffness), even, atol=1e-9)
    moved = way_of(seed)
    stopped = np.concatenate([moved, np.repeat(moved[-1:], 90, 0)])
    np.testing.assert_allclose(shown(stopped, stiffness)[-1], moved[-1], atol=1e-3)


@laws
@given(SEEDS, st.floats(0.1, 2.0), st.floats(0.02, 0.9))
def test_follow_through_is_linear_in_motion_exaggeration_and_softness(seed, size, stiffness):
    way = way_of(seed)
    whole = shown(way, np.full(5, FULL_SWING_STIFFNESS)) - way
    softness = min(np.log(stiffness) / np.log(FULL_SWING_STIFFNESS), 1.0)
    far = 0.3 / max(np.abs(whole).max() * np.sqrt(3), 1e-9)  # below where it is held back
    size, more = min(size, far), min(2.0, far)
    np.testing.assert_allclose(
        shown(size * way, np.full(5, FULL_SWING_STIFFNESS)) - size * way, size * whole, atol=1e-9
    )
    np.testing.assert_allclose(
        shown(way, np.full(5, FULL_SWING_STIFFNESS), more) - way, more * whole, atol=1e-9
    )
    np.testing.assert_allclose(shown(way, np.full(5, stiffness)) - way, softness * whole, atol=1e-9)


@laws
@given(SEEDS, st.floats(0.0, 4.0), st.floats(0.0, 4.0), st.integers(1, 58))
def test_another_exaggeration_counts_from_its_frame_on(seed, first, then, at):
    """The swing itself does not depend on it; what did not swing begins without any offset."""
    way, stiffness = way_of(seed), np.geomspace(0.01, 2.0, 5)
    swing, followed = FollowThrough(stiffness, first), []
    for k, places in enumerate(way):
        if k == at:
            swing.set_exaggeration(then)
        followed.append(swing(places, k * FRAME))
    np.testing.assert_array_equal(followed[:at], shown(way, stiffness, first)[:at])
    after = FollowThrough(stiffness, then)
    begun = [after(places, k * FRAME) for k, places in enumerate(way) if first or k >= at]
    np.testing.assert_array_equal(followed[at:], begun[-(len(way) - at) :])


def test_a_stop_is_overshot_as_a_damped_spring_does_and_never_far():
    pace = np.concatenate([np.arange(30) / 30.0, np.full(60, 29 / 30)])
    way = np.zeros((90, 1, 3))
    way[:, 0, 0] = pace
    past = shown(way, [FULL_SWING_STIFFNESS])[:, 0, 0].max() - pace[-1]
    # After a constant speed v, the overshoot is v / w exp(-d / sqrt(1 - d^2) acos(d)), here 5.8 cm.
    assert 0.05 < past < 0.065
    assert shown(10 * way, [FULL_SWING_STIFFNESS], 4.0)[:, 0, 0].max() - 10 * pace[-1] <= 0.35 + 1e-9


@laws
@given(SEEDS, st.floats(0.001, 0.3))
def test_the_closed_form_is_many_small_steps(seed, seconds):
    offset, speed = np.random.default_rng(seed).normal(size=(2, 4, 3))
    exact = advance_oscillators(offset, speed, seconds)
    rate, drag, step = 4.0 * np.pi, 0.25, seconds / 4_000
    for _ in range(4_000):
        speed = speed - step * (rate**2 * offset + 2 * drag * rate * speed)
        offset = offset + step * speed
    np.testing.assert_allclose(exact[0], offset, atol=5e-3)
    np.testing.assert_allclose(exact[1], speed, atol=5e-2)
