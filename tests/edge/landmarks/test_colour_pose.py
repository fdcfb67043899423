"""Tests that colour improves tracking if depth is insufficient, and is optional."""

import dataclasses

import numpy as np
import pytest

from enliven.person.joints import Joint
from enliven_edge.landmarks.colour_pose import ColourPoseEstimator
from enliven_edge.tracking.settings import SmoothingSettings, TrackerSettings
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.sensor.synthetic import SyntheticSensor

RAW = TrackerSettings(smoothing=SmoothingSettings(amount=0.0))
FRAMES = 25


class Truth:
    """A landmark source that returns the true landmarks of the next frame."""

    def __init__(self, landmarks_of) -> None:
        self.landmarks_of, self.asked = landmarks_of, 0

    def show(self, joints, camera, mount) -> None:
        self.found = self.landmarks_of(joints, camera, mount)

    def find(self, colour, time_ns):
        self.asked += 1
        return [self.found]


def errors(landmarks_of, *, with_colour: bool, eye: bool) -> tuple[np.ndarray, np.ndarray, int]:
    """Returns (F, 20) errors in metres and (F, 20) confidence. Half of the depth below the hips is
    missing.
    """
    truth_source, away, sure = Truth(landmarks_of), [], []
    tracker = Tracker(RAW, ColourPoseEstimator(truth_source) if eye else None)
    with SyntheticSensor(choreography="walk", width=320, realtime=False) as sensor:
        for i in range(FRAMES):
            frame = sensor.read()
            joints = sensor.truth(frame.time_ns).joints
            truth_source.show(joints, frame.intrinsics, frame.world_from_camera)
            colour = np.zeros((240, 320, 3), np.uint8) if with_colour else None
            depth = frame.depth.copy()
            holes = np.random.default_rng(i).random((24, 32)).repeat(10, 0).repeat(10, 1) < 0.5
            holes[:130] = False
            depth[holes] = 0
            bodies = tracker.track(dataclasses.replace(frame, colour=colour, depth=depth))
            if bodies:
                away.append(np.linalg.norm(bodies[0].joints - joints, axis=1))
                sure.append(bodies[0].confidence)
    return np.array(away), np.array(sure), truth_source.asked


@pytest.mark.slow
def test_colour_improves_joints_that_depth_hardly_shows(landmarks_of):
    plain, unsure, _ = errors(landmarks_of, with_colour=True, eye=False)
    helped, surer, asked = errors(landmarks_of, with_colour=True, eye=True)
    legs = [Joint.KNEE_LEFT, Joint.KNEE_RIGHT, Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT]
    assert asked > 15
    assert helped[:, legs].mean() < 0.9 * plain[:, legs].mean()
    assert surer[:, legs].mean() >= min(0.98, unsure[:, legs].mean())


@pytest.mark.slow
def test_without_colour_no_landmarks_are_requested(landmarks_of):
    plain, _, _ = errors(landmarks_of, with_colour=False, eye=False)
    same, _, asked = errors(landmarks_of, with_colour=False, eye=True)
    assert asked == 0
    np.testing.assert_array_equal(plain, same)
