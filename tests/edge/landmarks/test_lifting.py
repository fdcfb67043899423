"""Tests of lifting 2D landmarks to 3D by depth, or by body height alone. Landmarks are exact, depth is
noisy.
"""

import dataclasses

import numpy as np
import pytest

from enliven.errors import InputError
from enliven.person.joints import Joint
from enliven_edge.landmarks import lifting
from enliven_edge.landmarks.lifting import WEIGHTS, Lifter, LiftSettings, joint_visibility
from enliven_synthesis.sensor.synthetic import SyntheticSensor

LIMBS = [j for j in Joint if j not in (Joint.HIP_CENTER, Joint.SPINE)]


def seen(choreography="walk", frames=20, every=5):
    """Returns frames with a colour image of twice the size, and the true bodies."""
    with SyntheticSensor(choreography=choreography, width=320, realtime=False) as sensor:
        for i in range(frames):
            frame = sensor.read()
            if i % every == 0:
                colour = np.zeros((480, 640, 3), np.uint8)
                yield dataclasses.replace(frame, colour=colour), sensor.truth(frame.time_ns)


def test_a_joint_s_shares_of_the_landmarks_are_one():
    np.testing.assert_allclose(WEIGHTS.sum(1), 1.0)
    assert joint_visibility(np.ones(33)).min() == 1.0


@pytest.mark.parametrize("choreography", ["walk", "wave"])
@pytest.mark.parametrize("scale", [0.8, 1.0, 1.25])
def test_lifted_joints_are_correct_for_any_source_scale(landmarks_of, choreography, scale):
    lifter = Lifter()
    for frame, truth in seen(choreography):
        landmarks = landmarks_of(truth.joints, frame.intrinsics, frame.world_from_camera, scale)
        landmarks = dataclasses.replace(landmarks, points=2 * landmarks.points + 0.5)
        body = lifter.lift(landmarks, frame, frame.world_from_camera, 7)
        away = np.linalg.norm(body.joints - truth.joints, axis=1)
        assert body.id == 7
        assert np.mean(away[LIMBS]) < 0.05 and np.max(away[LIMBS]) < 0.15
        assert np.max(away[[Joint.HIP_CENTER, Joint.SPINE]]) < 0.15
        assert body.confidence.mean() > 0.7


def test_occluder_does_not_carry_a_limb_away(landmarks_of):
    """A board is in front of the left hand. The hand stays with the body, with low confidence."""
    for frame, truth in seen("idle", 1):
        landmarks = landmarks_of(truth.joints, frame.intrinsics, frame.world_from_camera)
        landmarks = dataclasses.replace(landmarks, points=2 * landmarks.points + 0.5)
        u, v = np.rint(landmarks.points[15] / 2).astype(int)
        depth = frame.depth.copy()
        depth[v - 20 : v + 30, u - 12 : u + 12] = 1000
        body = Lifter().lift(landmarks, dataclasses.replace(frame, depth=depth), frame.world_from_camera, 1)
    away = np.linalg.norm(body.joints - truth.joints, axis=1)
    assert away[[Joint.WRIST_LEFT, Joint.HAND_LEFT]].max() < 0.15
    assert body.confidence[Joint.HAND_LEFT] < 0.4 < body.confidence[Joint.HAND_RIGHT]


def test_holes_leave_the_posture_and_little_confidence(landmarks_of):
    for frame, truth in seen("idle", 1):
        landmarks = landmarks_of(truth.joints, frame.intrinsics, frame.world_from_camera)
        landmarks = dataclasses.replace(landmarks, points=2 * landmarks.points + 0.5)
        depth = frame.depth.copy()
        depth[140:] = 0
        body = Lifter().lift(landmarks, dataclasses.replace(frame, depth=depth), frame.world_from_camera, 1)
    away = np.linalg.norm(body.joints - truth.joints, axis=1)
    assert away[Joint.FOOT_LEFT] < 0.2
    assert body.confidence[Joint.FOOT_LEFT] == pytest.approx(lifting.CONFIDENCE_WITHOUT_DEPTH)
    assert body.confidence[Joint.HEAD] > 0.8


def test_joints_outside_the_image_are_not_lifted(landmarks_of):
    for frame, truth in seen("idle", 1):
        low = truth.joints - [0.0, 1.0, 0.0]
        landmarks = landmarks_of(low, frame.intrinsics, frame.world_from_camera)
        landmarks = dataclasses.replace(landmarks, points=2 * landmarks.points + 0.5)
        body = Lifter().lift(landmarks, frame, frame.world_from_camera, 1)
    assert body.confidence[[Joint.FOOT_LEFT, Joint.FOOT_RIGHT]].max() == 0.0
    assert np.isfinite(body.joints).all()


def test_without_depth_the_height_gives_the_distance(landmarks_of):
    for frame, truth in seen():
        lifter = Lifter(LiftSettings(body_height=truth.height))
        landmarks = landmarks_of(truth.joints, frame.intrinsics, frame.world_from_camera, 0.7)
        body = lifter.lift_without_depth(landmarks, frame.intrinsics, frame.world_from_camera, 1)
        assert np.linalg.norm(body.joints - truth.joints, axis=1).mean() < 0.12
        assert 0.0 < body.confidence.max() <= lifting.CONFIDENCE_WITHOUT_DEPTH


def test_noise_instead_of_landmarks_gives_finite_joints(landmarks_of):
    random = np.random.default_rng(0)
    for frame, truth in seen("idle", 1):
        good = landmarks_of(truth.joints, frame.intrinsics, frame.world_from_camera)
        for _ in range(20):
            landmarks = dataclasses.replace(
                good, points=random.normal(200, 400, (33, 2)), offsets=random.normal(size=(33, 3)),
                visibility=random.random(33),
            )  # fmt: skip
            for body in (
                Lifter().lift(landmarks, frame, frame.world_from_camera, 1),
                Lifter().lift_without_depth(landmarks, frame.intrinsics, frame.world_from_camera, 1),
            ):
                assert np.isfinite(body.joints).all()
                assert body.confidence.min() >= 0.0 and body.confidence.max() <= 1.0


def test_a_frame_without_colour_is_refused(landmarks_of):
    for frame, truth in seen("idle", 1):
        landmarks = landmarks_of(truth.joints, frame.intrinsics, frame.world_from_camera)
        with pytest.raises(InputError, match="colour"):
            Lifter().lift(landmarks, dataclasses.replace(frame, colour=None), frame.world_from_camera, 1)
