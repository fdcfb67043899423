"""Tests of joint ranges: identity inside, bounded outside, continuous, mirror-symmetric, and equal to a slow
reference.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from enliven.motion.kinematics.ranges import (
    FREE_SWING,
    FREE_TWIST,
    MAX_UNKNOWN_SWING,
    MAX_UNKNOWN_TWIST,
    SOFT_MARGIN,
    fit_joint_range,
    limit_turns,
    limit_turns_towards,
)
from enliven.rotation import conjugate, from_rotation_vector, multiply, normalized, rotate, to_rotation_vector

SEEDS = st.integers(0, 10_000)
MIRROR = np.array([1.0, 1.0, -1.0, -1.0])
"""Factors of a quaternion under reflection in the plane x = 0."""
DOWN = np.array([0.0, -1.0, 0.0])


def made(random, frames=12):
    """Returns a bone, known rotations of the bone, and its range."""
    bone = random.normal(size=3)
    turns = from_rotation_vector(random.normal(size=(frames, 3)) * random.uniform(0.0, 0.5, size=3))
    return bone / np.linalg.norm(bone), turns, fit_joint_range(bone, turns)


def any_turns(random, count=200):
    return normalized(random.normal(size=(count, 4)))


def degrees_apart(one, other):
    return np.degrees(np.linalg.norm(to_rotation_vector(multiply(conjugate(one), other)), axis=-1))


def parts(bone, turn):
    """Returns the swing (3,) and the twist of a rotation (4,), by SciPy. The twist is applied first."""
    turn = Rotation.from_quat(np.roll(turn, -1))
    there = turn.apply(bone)
    axis = np.cross(bone, there)
    swing = np.arccos(np.clip(bone @ there, -1.0, 1.0)) * axis / max(np.linalg.norm(axis), 1e-300)
    return swing, float((Rotation.from_rotvec(swing).inv() * turn).as_rotvec() @ bone)


def gives_way(swing, twist):
    """Returns the common factor of swing and twist. Together, they may exceed the range by a free angle that
    forms an ellipse.
    """
    off = np.hypot(swing, twist)
    share = np.hypot(swing / FREE_SWING, twist / FREE_TWIST)
    free = off / max(share, 1e-300)
    return 1.0 if share <= 1.0 else (free + SOFT_MARGIN * (1.0 - np.exp((free - off) / SOFT_MARGIN))) / off


def slow_limit(bone, known, turn):
    """Returns a limited rotation: the nearest mixture of the known swings and the rest pose, extended
    outwards.
    """
    swings, twists = zip(*(parts(bone, each) for each in known), strict=True)
    swing, twist = parts(bone, turn)
    corners = np.array([np.zeros(3), *swings]).T
    # Weights of a mixture are at least 0 and sum to 1.
    weights = nnls(np.vstack([corners, np.full(corners.shape[1], 1e4)]), np.append(swing, 1e4))[0]
    nearest = corners @ weights
    near = np.clip(twist, min(0.0, *twists), max(0.0, *twists))
    factor = gives_way(np.linalg.norm(swing - nearest), abs(twist - near))
    swing, twist = nearest + factor * (swing - nearest), near + factor * (twist - near)
    return np.roll((Rotation.from_rotvec(swing) * Rotation.from_rotvec(twist * bone)).as_quat(), 1)


def is_far_from_half_a_turn(bone, turn):
    swing, twist = parts(bone, turn)
    return max(abs(twist), np.linalg.norm(swing)) < 2.3


@settings(max_examples=8, deadline=None)
@given(SEEDS)
def test_limits_equal_those_of_the_slow_twin(seed):
    random = np.random.default_rng(seed)
    bone, samples, joint = made(random)
    turns = from_rotation_vector(random.normal(size=(20, 3)) * 0.7)
    turns = turns[[is_far_from_half_a_turn(bone, turn) for turn in turns]]
    wanted = np.array([slow_limit(bone, samples, turn) for turn in turns])
    assert len(turns) > 5
    assert degrees_apart(limit_turns_towards(joint, turns, np.zeros(2)), wanted).max() < 0.01


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_turns_within_the_range_are_returned_unchanged(seed):
    random = np.random.default_rng(seed)
    bone, samples, joint = made(random)
    np.testing.assert_array_equal(limit_turns(joint, samples), samples)
    small = from_rotation_vector(random.normal(size=(50, 3)) * 0.15)
    np.testing.assert_array_equal(limit_turns(fit_joint_range(bone), small), small)


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_every_turn_ends_within_the_range_and_its_margin(seed):
    random = np.random.default_rng(seed)
    bone, samples, joint = made(random)
    swings, twists = zip(*(parts(bone, part) for part in samples), strict=True)
    for rest, swing, twist in (
        (joint, max(map(np.linalg.norm, swings)) + FREE_SWING, max(map(abs, twists)) + FREE_TWIST),
        (fit_joint_range(bone), MAX_UNKNOWN_SWING, MAX_UNKNOWN_TWIST),
    ):
        limited = limit_turns(rest, any_turns(random))
        np.testing.assert_allclose(np.linalg.norm(limited, axis=1), 1.0, atol=1e-9)
        limits = [parts(bone, turn) for turn in limited]
        assert max(np.linalg.norm(part[0]) for part in limits) < swing + SOFT_MARGIN + 1e-9
        assert max(abs(part[1]) for part in limits) < twist + SOFT_MARGIN + 1e-9


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_small_changes_of_a_turn_change_the_result_by_little(seed):
    """Everywhere, also where a bone points the opposite way and where it is twisted by half a turn."""
    random = np.random.default_rng(seed)
    bone, _, joint = made(random)
    across = np.cross(bone, rotate(from_rotation_vector(random.normal(size=3)), bone))
    half = from_rotation_vector(np.pi * across / np.linalg.norm(across))
    twisted = from_rotation_vector(np.pi * bone)
    edges = np.concatenate([np.tile(half, (20, 1)), np.tile(twisted, (20, 1))])
    edges = multiply(edges, from_rotation_vector(random.normal(size=(40, 3)) * 1e-3))
    turns, far = np.concatenate([any_turns(random), edges]), joint.hull.mean(0)
    for size in (1e-3, 1e-5):
        other = multiply(turns, from_rotation_vector(random.normal(size=(len(turns), 3)) * size))
        moved = degrees_apart(limit_turns_towards(joint, turns, far), limit_turns_towards(joint, other, far))
        assert (moved <= 12.0 * degrees_apart(turns, other) + 1e-4).all()


def test_a_larger_turn_stays_the_larger_one_until_it_nears_half_a_turn():
    angles = np.radians(np.arange(0.0, 135.0))
    for axis in ([1.0, 0.0, 0.0], [0.6, 0.0, 0.8], [0.0, 1.0, 0.0]):
        limited = limit_turns(fit_joint_range(DOWN), from_rotation_vector(angles[:, None] * axis))
        sizes = np.linalg.norm(to_rotation_vector(limited), axis=1)
        assert (np.diff(sizes) > 0.0).all()
        assert (np.diff(sizes) <= np.diff(angles) + 1e-12).all()


def test_an_arm_that_is_raised_through_half_a_turn_stays_at_its_limit():
    """It does not fall back while the performer's arm is overhead, nor jump as it passes the vertical."""
    angles = np.radians(np.concatenate([np.arange(0.0, 200.0), np.arange(200.0, 0.0, -1.0)]))
    limited = limit_turns(fit_joint_range(DOWN), from_rotation_vector(-angles[:, None] * [1.0, 0.0, 0.0]))
    raised = np.linalg.norm(to_rotation_vector(limited), axis=1)[(angles > 1.6) & (angles < np.pi)]
    assert np.degrees(raised.min()) > 80.0
    assert degrees_apart(limited[1:], limited[:-1]).max() < 8.0


def test_a_bone_that_is_twisted_far_swings_less_far():
    """Its combined rotation, not each part, may exceed the known rotations by the free angle and the
    margin.
    """
    knee = from_rotation_vector(np.radians(np.linspace(0.0, 60.0, 7))[:, None] * [1.0, 0.0, 0.0])
    joint = fit_joint_range(DOWN, knee)
    swing = Rotation.from_rotvec([np.radians(85.0), 0.0, 0.0])
    swings = []
    for twist in (0.0, 60.0, 120.0):
        turn = swing * Rotation.from_rotvec(np.radians(twist) * DOWN)
        got, about = parts(DOWN, limit_turns(joint, np.roll(turn.as_quat(), 1)[None])[0])
        swings.append(np.degrees(np.linalg.norm(got)))
        assert np.hypot(swings[-1] - 60.0, np.degrees(about)) < 50.0 + 1e-6
    assert swings[0] == pytest.approx(85.0) and swings[0] > swings[1] + 3.0 > swings[2] + 6.0


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_in_the_mirror_limits_are_alike(seed):
    random = np.random.default_rng(seed)
    bone, samples, joint = made(random)
    turns = any_turns(random)
    mirrored_joint = fit_joint_range(bone * [-1.0, 1.0, 1.0], samples * MIRROR)
    mirrored_limits = limit_turns(mirrored_joint, turns * MIRROR)
    assert degrees_apart(mirrored_limits, limit_turns(joint, turns) * MIRROR).max() < 1e-5


def test_the_bones_of_a_spine_share_the_limits_of_one():
    bend = np.array([np.radians(170.0) / 4.0, 0.0, 0.0])
    turn = limit_turns(fit_joint_range(DOWN, None, 0.25), from_rotation_vector(bend)[None])
    assert (
        MAX_UNKNOWN_SWING < 4.0 * np.linalg.norm(to_rotation_vector(turn)) < MAX_UNKNOWN_SWING + SOFT_MARGIN
    )


@pytest.mark.parametrize("angle", [0.0, 40.0, 90.0])
def test_a_hinge_of_the_clips_bends_one_way_only(angle):
    """A knee bends by up to 90 degrees in the clips, so this is not limited. Backwards, only the free angle
    is allowed.
    """
    knee = from_rotation_vector(np.radians(np.linspace(0.0, 90.0, 10))[:, None] * [1.0, 0.0, 0.0])
    bent = from_rotation_vector(np.radians([[angle, 0.0, 0.0], [-100.0, 0.0, 0.0]]))
    got = limit_turns(fit_joint_range(DOWN, knee), bent)
    np.testing.assert_array_equal(got[0], bent[0])
    assert 45.0 < np.degrees(np.linalg.norm(to_rotation_vector(got[1]))) < 50.0
