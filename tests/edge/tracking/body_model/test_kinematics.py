"""Tests of the body's frames: rotations and their logarithms, rigid bones, and correct sides."""

import numpy as np
import pytest
from bodies_for_tests import body_of, random_posture
from hypothesis import example, given, settings
from hypothesis import strategies as st

from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.kinematics import deviation, exponential, logarithm
from enliven_edge.tracking.body_model.posture import Posture, predict_next


@given(st.integers(0, 10_000))
@settings(max_examples=50, deadline=None)
def test_logarithm_inverts_exponential(seed):
    v = np.random.default_rng(seed).normal(size=3)
    v *= min(1.0, 3.1 / np.linalg.norm(v))
    np.testing.assert_allclose(logarithm(exponential(v)), v, atol=1e-6)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0.8, 0), (-0.48, 0.6, 0.64)])
def test_logarithm_of_half_a_turn(axis):
    half_turn = exponential(np.pi * np.array(axis, float))
    np.testing.assert_allclose(exponential(logarithm(half_turn)), half_turn, atol=1e-12)


@given(st.integers(0, 10_000), st.floats(0.0, 1.0))
@settings(max_examples=100, deadline=None)
@example(0, 0.99999)  # 1e-5 less than 180 degrees, where the axis once had the wrong sign
def test_a_deviation_is_the_logarithm_of_the_turn_between(seed, share):
    """For any angle: zero, small, about a half turn."""
    random = np.random.default_rng(seed)
    reference, axis = exponential(random.normal(size=3)), random.normal(size=3)
    angle = random.choice([share * 1e-4, share * np.pi, np.pi - 1e-5 * share])
    turned = reference @ exponential(angle * axis / np.linalg.norm(axis))
    vector = deviation(reference, turned)
    np.testing.assert_allclose(reference @ exponential(vector), turned, atol=1e-9)
    assert np.linalg.norm(vector) <= np.pi + 1e-12
    if abs(angle) < np.pi - 1e-9:  # half a turn has two logarithms
        np.testing.assert_allclose(vector, logarithm(reference.T @ turned), atol=1e-9)


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_pivots_are_linear_in_the_lengths_with_raised_arms_too(seed):
    """Their derivatives by the lengths, times the lengths, equal their positions relative to the hips."""
    posture = random_posture(seed, 1.0)
    _, pivots, by_length, *_ = body_of(posture)
    np.testing.assert_allclose(by_length @ posture.lengths, pivots - posture.position, atol=1e-12)
    unlike = np.random.default_rng(seed).uniform(0.5, 1.5, 12) * posture.lengths
    other = Posture(posture.position, posture.rotations, unlike)
    np.testing.assert_allclose(by_length @ unlike, body_of(other)[1] - posture.position, atol=1e-12)


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_forward_kinematics_keeps_bone_lengths(seed):
    from enliven.person.joints import BONES

    resting = Posture(np.zeros(3), joint_limits.standing_pose(), model.lengths_for_height(1.7)).joints()
    joints = random_posture(seed, 0.8).joints()
    for a, b in BONES:
        if (a, b) not in ((0, 1), (14, 15), (18, 19)):  # these rotate a frame's pivot
            assert np.linalg.norm(joints[a] - joints[b]) == pytest.approx(
                np.linalg.norm(resting[a] - resting[b])
            )


def test_mirroring_twice_changes_nothing():
    rotations = random_posture(5).rotations
    np.testing.assert_allclose(
        joint_limits.mirror_rotations(joint_limits.mirror_rotations(rotations)), rotations, atol=1e-12
    )


def test_standing_height_is_the_height_asked_for():
    for height in (1.2, 1.75, 2.0):
        assert model.body_height_from_lengths(model.lengths_for_height(height)) == pytest.approx(
            height, rel=0.01
        )


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_bones_lie_where_their_orientations_say(seed):
    """Limbs lie along -Y of their bone's frame, the spine and the neck along +Y, the shoulders sideways."""
    from enliven.person.joints import Joint
    from enliven.rotation import rotate

    posture = random_posture(seed, 0.8)
    joints, turned = posture.joints(), posture.orientations()
    down, up = np.array([0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0])
    for first in (Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT):
        for k in (1, 2, 3):
            bone = joints[first + k] - joints[first + k - 1]
            np.testing.assert_allclose(
                bone / np.linalg.norm(bone), rotate(turned[first + k], down), atol=1e-9
            )
    for knee in (Joint.KNEE_LEFT, Joint.KNEE_RIGHT):
        for k in (0, 1):
            bone = joints[knee + k] - joints[knee + k - 1]
            np.testing.assert_allclose(bone / np.linalg.norm(bone), rotate(turned[knee + k], down), atol=1e-9)
    for joint in (Joint.SHOULDER_CENTER, Joint.HEAD):
        bone = joints[joint] - joints[joint - 1]
        assert bone @ rotate(turned[joint], up) > 0.98 * np.linalg.norm(bone)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0)


def test_upright_posture_has_identity_rotations():
    turned = Posture(
        np.zeros(3), np.tile(np.eye(3), (13, 1, 1)), model.lengths_for_height(1.7)
    ).orientations()
    np.testing.assert_allclose(np.abs(turned[:, 0]), 1.0)


def test_left_joints_are_on_the_left():
    joints = Posture(np.zeros(3), joint_limits.standing_pose(), model.lengths_for_height(1.7)).joints()
    from enliven.person.joints import Joint

    assert joints[Joint.HAND_LEFT, 0] > 0 > joints[Joint.HAND_RIGHT, 0]
    assert joints[Joint.FOOT_LEFT, 2] > joints[Joint.ANKLE_LEFT, 2]


def test_predicted_posture_continues_its_rotation():
    """It continues by a fraction of the last rotation, and never faster than a person can turn."""
    before, now = random_posture(1, 0.1), random_posture(1, 0.1)
    slow, fast = np.array([0.1, -0.05, 0.02]), np.array([0.0, 2.0, 0.0])
    now.rotations[model.HEAD] = before.rotations[model.HEAD] @ exponential(slow)
    now.rotations[model.CHEST] = before.rotations[model.CHEST] @ exponential(fast)
    predicted = predict_next(before, now)
    for frame, turn in ((model.HEAD, 0.8 * slow), (model.CHEST, np.array([0.0, 0.25, 0.0]))):
        expected = now.rotations[frame] @ exponential(turn)
        np.testing.assert_allclose(predicted.rotations[frame], expected, atol=1e-9)
