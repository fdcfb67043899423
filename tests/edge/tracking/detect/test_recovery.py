"""Tests that the fit stays near observed joints, and that recovery moves a lost limb there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from estimates_for_tests import estimate_of, seen_as
from postures_seen_for_tests import observed
from tolerances import SOLVER_TOLERANCE, assert_alike

from enliven.person.joints import Joint
from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect import recovery
from enliven_edge.tracking.detect.fitted_frame import FittedFrame
from enliven_edge.tracking.detect.recovery import PoseRecovery
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.frame.observation import Observation
from enliven_edge.tracking.settings import FitSettings

LEFT_ARM = [Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.HAND_LEFT]
SURE = np.ones(20)
TURNS = 8
"""Number of frames within which a limb must be found again."""


def standing() -> Posture:
    return Posture(np.array([0.0, 0.95, -2.5]), joint_limits.standing_pose(), model.lengths_for_height(1.7))


def arm_out(lift: float = 1.4) -> Posture:
    """Returns a person with the left arm stretched out or higher, and the right arm hanging."""
    posture, out = standing(), joint_limits.standing_pose(arm_raise=lift)
    posture.rotations[[model.UPPER_ARM_L, model.FOREARM_L]] = out[[model.UPPER_ARM_L, model.FOREARM_L]]
    return posture


def seen_of(posture: Posture, observation: Observation):
    """Returns an estimate with all joints known and uniform part probabilities at the points."""
    points = observation.points
    return seen_as(estimate_of(posture.joints()), points, np.full((len(points), 17), 1 / 17))


def off(posture: Posture, truth: Posture, joints) -> float:
    return float(np.linalg.norm(posture.joints() - truth.joints(), axis=1)[joints].max())


def reconsidered(observation: Observation, start: Posture, seen) -> Posture:
    """Returns a posture after some frames of recovery, with all capsules certain."""
    fitter = Fitter(FitSettings())
    pose_recovery = PoseRecovery(fitter)
    posture, report = fitter.fit(observation, start)
    for _ in range(TURNS):
        posture, report = pose_recovery.reconsider(FittedFrame(observation, posture, report, seen), SURE)
    return posture


@pytest.mark.parametrize("lift", [1.4, 2.6])
def test_a_limb_that_is_seen_elsewhere_is_brought_there(lift):
    observation = observed(arm_out(lift))
    recovered = reconsidered(observation, standing(), seen_of(arm_out(lift), observation))
    assert off(recovered, arm_out(lift), LEFT_ARM) < 0.08
    alone = reconsidered(observation, standing(), None)
    assert off(alone, arm_out(lift), LEFT_ARM) > 0.3, "which surfaces alone do not, where all seems sure"


def test_well_fitted_person_is_not_changed():
    fitter, observation = Fitter(FitSettings()), observed(arm_out())
    posture, report = fitter.fit(observation, arm_out())
    sighting = seen_of(posture, observation)
    frame = FittedFrame(observation, posture, report, sighting)
    recovered, same = PoseRecovery(fitter).reconsider(frame, SURE)
    assert recovered is posture and same is report


def test_limb_is_not_moved_against_the_depth():
    """The network is wrong, and the depth frame decides."""
    observation = observed(standing())
    recovered = reconsidered(observation, standing(), seen_of(arm_out(), observation))
    assert off(recovered, standing(), LEFT_ARM) < 0.08


def with_landmarks(observation: Observation, posture: Posture, joints=range(20)) -> Observation:
    """Returns the observation with some joints of a posture as landmarks."""
    landmarks = estimate_of(posture.joints()).landmarks
    landmarks[[j for j in range(20) if j not in joints], 3] = 0.0
    return replace(observation, landmarks=landmarks)


def test_a_hidden_limb_is_kept_where_its_joints_are_seen():
    """Shins and feet are behind a board. The landmarks show one bent knee."""
    bent, fitter = standing(), Fitter(FitSettings())
    bent.rotations[model.SHIN_L] = joint_limits.standing_pose(knee=0.6)[model.SHIN_L]
    plain = observed(standing(), hide=80)
    feet = [Joint.ANKLE_LEFT, Joint.FOOT_LEFT]
    without, _ = fitter.fit(plain, standing())
    fitted, _ = fitter.fit(with_landmarks(plain, bent, feet), standing())
    assert off(fitted, bent, feet) < 0.5 * off(without, bent, feet)


def test_landmarks_without_weight_change_nothing():
    plain, start = observed(standing()), arm_out()
    expected, report = Fitter(FitSettings()).fit(plain, start)
    unweighed = Fitter(FitSettings(landmarks=0.0)).fit(with_landmarks(plain, arm_out()), start)
    nothing = Fitter(FitSettings()).fit(with_landmarks(plain, arm_out(), ()), start)
    for fitted, other in (unweighed, nothing):
        assert_alike(fitted.joints(), expected.joints(), SOLVER_TOLERANCE)
        assert other.energy == report.energy


def test_landmarks_make_the_fit_surer():
    """The landmark belongs to a joint without other evidence."""
    fitter, plain = Fitter(FitSettings()), observed(standing(), hide=80)
    shin = 3 + int(np.flatnonzero(model.DOF_FRAME == model.SHIN_L)[0])
    uninformed, informed = (
        fitter.fit(each, standing(), iterations=0)[1].information[shin, shin]
        for each in (plain, with_landmarks(plain, standing()))
    )
    assert informed > 2.0 * uninformed


@pytest.mark.parametrize("step", [1, 3, 50])
def test_thinning_keeps_the_landmarks(step):
    observation = with_landmarks(observed(standing()), standing())
    thin = observation.thin(step)
    assert np.array_equal(thin.landmarks, observation.landmarks)
    surface, affinity, view, landmarks = thin.arrays
    assert surface.shape == (6, len(thin.points)) and affinity.size == 0
    assert view is observation.view and landmarks is thin.landmarks


@pytest.mark.parametrize(("loses", "kept"), [(1.0, False), (recovery.MAX_UNEXPLAINED, True)])
def test_recovery_keeps_observed_limb_against_the_network(loses, kept, monkeypatch):
    """The network is certain of a hanging arm, which therefore has a lower energy. But points stay
    unexplained.
    """
    monkeypatch.setattr(recovery, "MAX_UNEXPLAINED", loses)
    observation, fitter = observed(arm_out()), Fitter(FitSettings(landmarks=3.0))
    posture, report = fitter.fit(observation, arm_out())
    sighting = seen_of(standing(), observation)
    sure = replace(sighting, estimate=replace(sighting.estimate, expected_errors=np.full(20, 0.01)))
    misled = replace(observation, landmarks=sure.estimate.landmarks)
    recovered, _ = PoseRecovery(fitter).reconsider(FittedFrame(misled, posture, report, sure), SURE)
    assert (off(recovered, arm_out(), LEFT_ARM) < 0.1) == kept
