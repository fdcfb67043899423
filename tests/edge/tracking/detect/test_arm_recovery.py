"""Tests that an arm in front of the trunk that was fitted too deep is moved to its visible surface."""

from __future__ import annotations

import numpy as np
import pytest
from estimates_for_tests import estimate_of, seen_as
from hypothesis import given, settings
from hypothesis import strategies as st
from postures_seen_for_tests import observed

from enliven.person.joints import Joint
from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.capsules import ray_clearances, signed_distances
from enliven_edge.tracking.body_model.posture import Posture, rotation
from enliven_edge.tracking.detect.appearance import EstimateAtPoints
from enliven_edge.tracking.detect.arm_recovery import ArmRecovery
from enliven_edge.tracking.detect.arm_starts import ARM_JOINTS, arm_starts, densest_ball
from enliven_edge.tracking.detect.fitted_frame import FittedFrame
from enliven_edge.tracking.detect.proposals import Doubts
from enliven_edge.tracking.detect.recovery import PoseRecovery
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.frame.observation import Observation
from enliven_edge.tracking.settings import FitSettings

HANDS = [Joint.WRIST_LEFT, Joint.HAND_LEFT]
LEFT = (model.UPPER_ARM_L, model.FOREARM_L)
FOUND = 0.07
"""Maximum error in metres of a hand that counts as found."""
LOST = 0.12
"""Minimum error in metres of a hand that counts as lost."""
FRAMES = 5
"""Number of frames within which the arm must be found again. Without recovery it was lost for eight or
more.
"""
SAMPLED = 1e-4
"""Tolerance in metres: the nearest of 2,001 samples along an axis, and single precision."""
SURE = np.ones(20)
NO_DOUBTS = Doubts([], is_body_doubtful=False)


def forearm_across(forward: float) -> Posture:
    """Returns a posture with the left forearm across the belly and the elbow rotated forward, radians."""
    posture = Posture(
        np.array([0.0, 0.95, -2.5]), joint_limits.standing_pose(), model.lengths_for_height(1.75)
    )
    posture.rotations[model.UPPER_ARM_L] = rotation(x=-forward, z=0.1) @ rotation(y=-1.2)
    posture.rotations[model.FOREARM_L] = rotation(x=-1.6)
    return posture


TRUTH, TOO_DEEP = forearm_across(0.3), forearm_across(-0.35)


def off(posture: Posture) -> float:
    """Returns the larger error of left wrist and left hand, metres."""
    return float(np.linalg.norm(posture.joints() - TRUTH.joints(), axis=1)[HANDS].max())


def mistaken(observation: Observation) -> EstimateAtPoints:
    """Returns an estimate that is certain of the arm inside the trunk, and uncertain about all points."""
    points = observation.points
    return seen_as(estimate_of(TOO_DEEP.joints()), points, np.full((len(points), 17), 1 / 17))


@pytest.mark.slow
@pytest.mark.parametrize("told", [False, True], ids=["depth alone", "the network is mistaken"])
def test_an_arm_caught_in_the_trunk_comes_to_its_surface(told):
    observation, fitter = observed(TRUTH), Fitter(FitSettings())
    seen = mistaken(observation) if told else None
    posture, report = fitter.fit(observation, TOO_DEEP)
    for _ in range(FRAMES):
        posture, report = fitter.fit(observation, posture, predicted=posture)
    assert off(posture) > LOST, "the fit alone found it: nothing had to be recovered"
    recovery = PoseRecovery(fitter)
    usual = fitter.fit(observed(forearm_across(0.0)), forearm_across(0.0))
    recovery.reconsider(FittedFrame(observed(forearm_across(0.0)), *usual), SURE)
    for _ in range(FRAMES):
        posture, report = recovery.reconsider(FittedFrame(observation, posture, report, seen), SURE)
        posture, report = fitter.fit(observation, posture, predicted=posture)
    assert off(posture) < FOUND


def test_usual_frame_gets_no_extra_arm_fit():
    """If a confident arm at its visible position has the usual fit error, no extra fit is made."""
    fitter, observation = Fitter(FitSettings()), observed(TRUTH)
    posture, report = fitter.fit(observation, TRUTH)
    points = observation.points
    seen = seen_as(estimate_of(posture.joints()), points, np.full((len(points), 17), 1 / 17))
    arms = ArmRecovery(fitter)
    for _ in range(3):
        assert arms.propose(FittedFrame(observation, posture, report, seen), NO_DOUBTS) is None


def test_forearm_candidate_lies_along_unexplained_points():
    """The model's arm hangs. It does not explain points across the belly, so one candidate is there."""
    observation, hanging = observed(TRUTH), forearm_across(0.0)
    hanging.rotations[list(LEFT)] = joint_limits.standing_pose()[list(LEFT)]
    apart = [off(start()) for start in arm_starts(observation, hanging, None, [LEFT])]
    assert off(hanging) > 0.2
    assert min(apart) < LOST
    other = [j for j in range(20) if j not in ARM_JOINTS[LEFT]]
    for start in arm_starts(observation, hanging, None, [LEFT]):
        moved = np.linalg.norm(start().joints() - hanging.joints(), axis=1)
        assert moved[other].max() < 0.05, "only the arm moves"


def test_unexplained_points_are_measured_from_the_nearest_capsule():
    """Compared with every point and capsule, with dense samples along the axis."""
    dice = np.random.default_rng(3)
    ends, radii = TRUTH.capsules()
    points = dice.normal([0.0, 1.0, -2.5], 0.4, (40, 3)).astype(np.float32)
    along = np.linspace(0.0, 1.0, 2001)[:, None]
    twin = np.full(len(points), np.inf)
    for (a, b), (first, last) in zip(ends, radii, strict=True):
        away = np.linalg.norm(points[:, None] - (a + along * (b - a)), axis=2)
        nearest = away.argmin(1)
        thick = first + along[nearest, 0] * (last - first)
        twin = np.minimum(twin, away.min(1) - thick)
    np.testing.assert_allclose(signed_distances(points, ends, radii), twin, rtol=0, atol=SAMPLED)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1), st.floats(-0.5, 0.2), st.floats(0.1, 1.0))
@pytest.mark.slow
def test_rays_are_clear_of_capsules_by_the_least_distance_along_them(seed, near, long):
    """Compared with every ray and capsule, sampled densely along both."""
    dice = np.random.default_rng(seed)
    ends, radii = (each[:6] for each in TRUTH.capsules())
    points = dice.normal([0.0, 1.0, -2.5], 0.4, (8, 3)).astype(np.float32)
    eye = dice.normal([0.0, 1.2, 0.0], 0.1).astype(np.float32)
    away = (points - eye) / np.linalg.norm(points - eye, axis=1, keepdims=True)
    ray = points[:, None] + np.linspace(near, near + long, 401)[:, None] * away[:, None]
    along, twin = np.linspace(0.0, 1.0, 201), np.full(len(points), np.inf)
    for (a, b), (first, last) in zip(ends, radii, strict=True):
        distances = np.linalg.norm(ray[:, :, None] - (a + along[:, None] * (b - a)), axis=3)
        nearest = distances.reshape(len(points), -1).argmin(1)
        thick = first + along[nearest % len(along)] * (last - first)
        twin = np.minimum(twin, distances.min((1, 2)) - thick)
    clearances = ray_clearances(points, eye, near, near + long, ends, radii)
    np.testing.assert_allclose(clearances, twin, rtol=0, atol=2 * SAMPLED)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(1, 60))
def test_fullest_ball_is_around_the_point_with_most_neighbours(seed, count):
    # Multiples of a sixteenth: squares and sums are exact, and none equals the radius.
    points = (np.random.default_rng(seed).integers(-24, 24, (count, 3)) / 16).astype(np.float32)
    near = np.linalg.norm(points[:, None] - points[None], axis=2) < 0.7
    np.testing.assert_array_equal(densest_ball(points, np.float32(0.7)), near[near.sum(1).argmax()])
