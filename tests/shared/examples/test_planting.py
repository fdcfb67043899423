"""Tests that planted feet do not move in the world, and that other points are unchanged."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import assert_alike

from enliven.document.locomotion import LocomotionSettings, Switch
from enliven.examples.spacetime.locomotion import place_motion
from enliven.examples.spacetime.planting import lock_feet
from enliven.skeletons.facing import rotate_about_y

STEP = 1 / 60
FRAMES = 150


def shuffler(seed):
    """Returns two feet that take unequal steps in turn, a head, a yaw angle, and which feet stand."""
    rng = np.random.default_rng(seed)
    t = np.arange(FRAMES) * STEP
    phase = 2 * np.pi * rng.uniform(0.7, 1.4) * t
    share = rng.uniform(0.5, 1.5)
    left = np.stack([0 * t + 0.1, 0.1 * np.maximum(-np.sin(phase), 0), 0.3 * np.cos(phase)], 1)
    right = np.stack([0 * t - 0.1, 0.1 * np.maximum(np.sin(phase), 0), -0.3 * share * np.cos(phase)], 1)
    stands = np.stack([np.sin(phase) > -0.4, np.sin(phase) < 0.4], 1)
    places = np.stack([left, right, [0, 1, 0] + 0 * left], 1)
    return places, rng.uniform(-1, 1) * t, stands


def in_world(places, yaw, placed):
    return rotate_about_y(places, yaw[:, None]) + placed.root[:, None]


@given(st.integers(0, 10**6))
@settings(max_examples=25, deadline=None)
def test_feet_that_stand_do_not_slide(seed):
    places, yaw, stands = shuffler(seed)
    placed = place_motion(places, yaw, STEP, [Switch(0, "contact")], [0, 1], stands=stands)
    how = LocomotionSettings(plant=1.0)
    still = lock_feet(places, yaw, placed, [0, 1], stands, STEP, how)
    assert_alike(still[:, 2], places[:, 2])
    np.testing.assert_allclose(still[..., 1], places[..., 1], atol=1e-12)
    world = in_world(still, yaw, placed)
    for k in (0, 1):
        both = stands[1:, k] & stands[:-1, k]
        moved = np.linalg.norm(np.diff(world[:, k], axis=0)[:, [0, 2]], axis=1)
        assert moved[both].max() < 1e-9
        # The transition is smooth over the time of a blend, for the correction and the concurrent motion.
        before = np.linalg.norm(np.diff(placed.world[:, k], axis=0)[:, [0, 2]], axis=1)
        blend = how.contact.blend
        far = np.linalg.norm((world - placed.world)[:, k], axis=1).max() + before.max() * blend / STEP
        assert (moved - before).max() < 1.6 * far * STEP / blend + 1e-9
    # A standing anchor stays in place.
    for f in range(FRAMES):
        anchor = int(placed.anchors[f])
        if stands[f, anchor] and not stands[max(f - 8, 0) : f + 8].all(1).any():
            np.testing.assert_allclose(world[f, anchor], placed.world[f, anchor], atol=1e-9)


@given(st.integers(0, 10**6), st.floats(0.0, 1.0))
@settings(max_examples=10, deadline=None)
def test_partial_planting_moves_part_of_the_way(seed, part):
    places, yaw, stands = shuffler(seed)
    placed = place_motion(places, yaw, STEP, [Switch(0, "contact")], [0, 1], stands=stands)
    whole, some = (
        lock_feet(places, yaw, placed, [0, 1], stands, STEP, LocomotionSettings(plant=p)) for p in (1.0, part)
    )
    np.testing.assert_allclose(some - places, part * (whole - places), atol=1e-12)


def test_in_flight_nothing_is_held():
    places, yaw, stands = shuffler(1)
    placed = place_motion(places, yaw, STEP, [Switch(0, "flight")], [0, 1])
    still = lock_feet(places, yaw, placed, [0, 1], stands, STEP, LocomotionSettings(plant=1.0))
    flying = placed.anchors < 0
    assert flying.all()
    assert still == pytest.approx(places)
