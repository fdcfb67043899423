"""A mesh is never far from its performer's way, and as it was where it follows that anyway."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.examples.spacetime.following import drawn_back
from enliven.examples.spacetime.locomotion import PlacedMotion

STEP = 1 / 30
SIZE = 1.4


def placed_on(root):
    points = np.array([[0.1, 0.0, 0.2], [-0.1, 0.5, 0.0]])
    return PlacedMotion(root[:, None] + points, root, np.zeros(len(root), np.int64), ())


def wandering(rng, frames, far):
    """(F, 3) a smooth way over the floor."""
    t = np.arange(frames) * STEP
    at = sum(
        rng.normal(size=(2, 1)) * np.sin(rng.uniform(0.1, 0.6) * t + rng.uniform(0, 6)) for _ in range(3)
    )
    return np.stack([far * (at[0] - at[0, 0]), 0 * t + 0.3, far * (at[1] - at[1, 0])], 1)


@given(st.integers(0, 10**6), st.floats(0.2, 1.0), st.floats(-3, 3))
@settings(max_examples=20, deadline=None)
def test_it_drifts_no_farther_than_its_leash_whoever_stays(seed, leash, heading):
    rng = np.random.default_rng(seed)
    way = wandering(rng, 450, 0.1)
    drift = np.linspace(0, 4, 450)[:, None] * [np.sin(heading), 0.0, np.cos(heading)]
    steps = 0.05 * np.sin(np.arange(450) * STEP * 2 * np.pi)[:, None] * [0.0, 0.0, 1.0]
    made = drawn_back(placed_on(drift + steps), way, STEP, SIZE, leash)
    stays = 1.5 * SIZE * np.linalg.norm(way - way[0], axis=1).max()
    assert np.linalg.norm((made.root - made.root[0])[:, [0, 2]], axis=1).max() < leash + stays + 0.5
    np.testing.assert_allclose(made.root[:, 1], (drift + steps)[:, 1])
    moved = made.world - placed_on(drift + steps).world
    np.testing.assert_allclose(moved, np.tile((made.root - drift - steps)[:, None], (1, 2, 1)), atol=1e-12)
    # A step is seen as it was: what draws back is slow.
    pull = made.root - drift - steps
    assert np.abs(np.diff(pull, 2, axis=0)).max() / STEP**2 < 1.0


@given(st.integers(0, 10**6), st.floats(0.6, 1.4), st.floats(-3, 3))
@settings(max_examples=20, deadline=None)
def test_strides_of_its_own_and_another_heading_are_let_alone(seed, stride, heading):
    """A mesh that goes where the performer goes, in strides of its own, keeps its way to the last bit."""
    way = wandering(np.random.default_rng(seed), 300, 1.0)
    c, s = np.cos(heading), np.sin(heading)
    own = stride * SIZE * way @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    placed = placed_on(own)
    assert drawn_back(placed, way, STEP, SIZE, 0.3) is placed


def test_a_long_leash_is_none():
    placed = placed_on(np.linspace(0, 4, 450)[:, None] * [1.0, 0.0, 0.0])
    assert drawn_back(placed, np.zeros((450, 3)), STEP, SIZE, 1000.0) is placed
    near = drawn_back(placed, np.zeros((450, 3)), STEP, SIZE, 0.0)
    assert np.ptp(near.root[150:300, 0]) == pytest.approx(0.0, abs=0.01)
