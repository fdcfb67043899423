"""Tests of limb IK: exact if reachable, otherwise as near as possible, with constant bone lengths."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_strategies import seeds

from enliven.motion.kinematics.ik import two_bone
from enliven.motion.kinematics.reaching import reach_goal
from enliven.rotation import rotate

laws = settings(deadline=None, max_examples=80)
FRONT = (0.0, 0.0, 1.0)


def bent(limb, goal, side=FRONT):
    """Returns the positions of a limb's middle and end after two-bone IK, computed from plain rotations."""
    upper, lower = (np.array(q) for q in two_bone(*(tuple(p) for p in limb), tuple(goal), side))
    middle = limb[0] + rotate(upper, limb[1] - limb[0])
    return middle, middle + rotate(lower, limb[2] - limb[1])


@laws
@given(seeds)
def test_two_bones_reach_reachable_targets(seed):
    rng = np.random.default_rng(seed)
    limb = rng.normal(size=(3, 3))
    a, b = np.linalg.norm(np.diff(limb, axis=0), axis=1)
    way = rng.normal(size=3)
    goal = limb[0] + way / np.linalg.norm(way) * rng.uniform(abs(a - b), a + b)
    middle, end = bent(limb, goal)
    np.testing.assert_allclose(end, goal, atol=1e-7 * (a + b))
    assert np.linalg.norm(middle - limb[0]) == pytest.approx(a)
    # The bend stays in the plane that it has: the normal is turned by the swing alone.
    assert np.linalg.norm(end - middle) == pytest.approx(b)


@laws
@given(seeds, st.sampled_from([1e-6, 0.5, 5.0]))
def test_out_of_reach_the_limb_points_there(seed, beyond):
    rng = np.random.default_rng(seed)
    limb = rng.normal(size=(3, 3))
    a, b = np.linalg.norm(np.diff(limb, axis=0), axis=1)
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    _, end = bent(limb, limb[0] + way * (a + b) * (1 + beyond))
    np.testing.assert_allclose(end, limb[0] + way * (a + b), atol=1e-6 * (a + b))
    _, end = bent(limb, limb[0] + way * abs(a - b) * 0.5)
    np.testing.assert_allclose(end, limb[0] + way * abs(a - b), atol=1e-6 * (a + b))


def test_a_goal_that_is_met_already_turns_nothing():
    limb = np.array([[0, 1, 0], [0, 0.5, 0.1], [0, 0, 0.0]])
    upper, lower = two_bone(*(tuple(p) for p in limb), tuple(limb[2]), FRONT)
    np.testing.assert_allclose([upper, lower], [[1, 0, 0, 0]] * 2, atol=1e-7)


@pytest.mark.parametrize("side", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, -2.0)])
def test_a_straight_limb_bulges_to_the_side_that_is_given(side):
    limb = np.array([[0, 1.0, 0], [0, 0.5, 0], [0, 0, 0]])
    middle, end = bent(limb, (0.0, 0.2, 0.0), side)
    np.testing.assert_allclose(end, [0, 0.2, 0], atol=1e-9)
    out = (middle - [0, 0.6, 0]) / np.linalg.norm(middle - [0, 0.6, 0])
    np.testing.assert_allclose(out, np.array(side) / np.linalg.norm(side), atol=1e-6)


def test_odd_limbs_stay_finite():
    point = np.zeros((3, 3))
    short = np.array([[0, 0, 0], [0, 0, 0], [0, 1.0, 0]])
    back = np.array([[0, 0, 0], [0, 1.0, 0], [0, 0, 0.0]])
    along = np.array([[0, 1.0, 0], [0, 0.5, 0], [0, 0, 0]])
    for limb in (point, short, back, along):
        for goal in ((0.0, 0.0, 0.0), (0.0, 0.5, 0.0), (0.3, 0.2, 0.1)):
            for side in (FRONT, (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)):
                assert np.isfinite(two_bone(*(tuple(p) for p in limb), goal, side)).all()


@laws
@given(seeds, st.integers(2, 12), st.booleans())
def test_chains_reach_reachable_targets(seed, count, straight):
    rng = np.random.default_rng(seed)
    links = np.tile(rng.normal(size=3), (count - 1, 1)) if straight else rng.normal(size=(count - 1, 3))
    sizes = np.linalg.norm(links, axis=1)
    points = np.concatenate([[rng.normal(size=3)], links]).cumsum(0)
    before, whole = points.copy(), sizes.sum()
    way = rng.normal(size=3)
    away = way / np.linalg.norm(way) * rng.uniform(0.5, 1.3) * whole
    goal, turns = points[0] + away, np.empty((count - 1, 4))
    reach_goal(points, tuple(goal), FRONT, turns)
    nearest = max(2 * sizes.max() - whole, 0.0)
    far = np.linalg.norm(away)
    expected = points[0] + away / far * np.clip(far, nearest, whole)
    assert np.linalg.norm(points[-1] - expected) < 1e-6 * whole
    np.testing.assert_allclose(np.linalg.norm(np.diff(points, axis=0), axis=1), sizes, rtol=1e-9)
    np.testing.assert_allclose(points[0], before[0])
    np.testing.assert_allclose(rotate(turns, np.diff(before, axis=0)), np.diff(points, axis=0), atol=1e-9)
