"""Tests that the tracker follows people of unknown shape, finds them again, and tolerates bad frames."""

import dataclasses

import numpy as np
import pytest

from enliven.camera import Intrinsics, pixel_rays, unproject_depth, world_from_level_camera
from enliven.frames import DepthFrame
from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven_edge.tracking.settings import SceneSettings, SmoothingSettings, TrackerSettings
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.sensor.scene import cast_room
from enliven_synthesis.sensor.synthetic import SyntheticSensor

HALF = 320
APPEARS = 6
"""Number of frames within which a person in the first frame is detected (a fifth of a second)."""


def recorded(choreography: str, frames: int, start: int = 0, **options):
    """Returns [(frame, truth)] of a synthetic performer. The tracker has to estimate the mounting."""
    with SyntheticSensor(choreography=choreography, width=HALF, realtime=False, **options) as sensor:
        recording = []
        for _ in range(start + frames):
            frame = sensor.read()
            recording.append(
                (dataclasses.replace(frame, world_from_camera=None), sensor.truth(frame.time_ns))
            )
        return recording[start:]


def errors(tracked: list[list[Body]], truth: list[Body]) -> np.ndarray:
    """Returns (F, 20) distances between tracked and true joints in metres; NaN without a body."""
    return np.stack(
        [
            np.linalg.norm(bodies[0].joints - true.joints, axis=1) if bodies else np.full(20, np.nan)
            for bodies, true in zip(tracked, truth, strict=True)
        ]
    )


@pytest.mark.parametrize("choreography", ["wave", "walk"])
def test_tracker_follows_person_within_centimetres(choreography):
    recording = recorded(choreography, 60)
    tracker = Tracker()
    tracked = [tracker.track(frame) for frame, _ in recording]
    error = errors(tracked, [truth for _, truth in recording])[APPEARS:]
    assert not np.isnan(error).any(), "the person was lost"
    assert error.mean() < 0.05
    assert np.percentile(error, 95) < 0.12


@pytest.mark.slow
def test_the_person_keeps_one_identity_and_left_stays_left():
    recording = recorded("walk", 40)
    tracker = Tracker()
    for n, (frame, truth) in enumerate(recording):
        bodies = tracker.track(frame)
        if n < APPEARS:
            continue
        (body,) = bodies
        assert body.id == 1
        side = truth.joints[Joint.SHOULDER_LEFT] - truth.joints[Joint.SHOULDER_RIGHT]
        shoulders = body.joints[Joint.SHOULDER_LEFT] - body.joints[Joint.SHOULDER_RIGHT]
        assert shoulders @ side > 0


def test_the_sensor_finds_out_where_it_stands():
    (frame, _), *_ = recorded("idle", 1)
    with SyntheticSensor(choreography="idle", width=HALF, realtime=False) as sensor:
        true = sensor.read().world_from_camera
    tracker = Tracker()
    tracker.track(frame)
    assert tracker.world_from_camera is not None
    assert tracker.world_from_camera[1, 3] == pytest.approx(true[1, 3], abs=0.06)
    np.testing.assert_allclose(tracker.world_from_camera[:3, :3], true[:3, :3], atol=0.04)


@pytest.mark.slow
def test_a_camera_that_starts_with_empty_frames_finds_its_floor_later():
    recording = recorded("idle", 40)
    tracker = Tracker()
    for i, (frame, _) in enumerate(recording):
        depth = np.zeros_like(frame.depth) if i < 5 else frame.depth
        bodies = tracker.track(dataclasses.replace(frame, depth=depth))
    assert bodies
    assert np.linalg.norm(bodies[0].joints - recording[-1][1].joints, axis=1).mean() < 0.15
    assert tracker.world_from_camera[1, 3] == pytest.approx(1.15, abs=0.2)


@pytest.mark.slow
def test_a_body_earns_its_confidence():
    """The confidence is at most 0.6 in the first frame, and after a third of a second that of the fit."""
    tracker, first_ns = Tracker(), None
    for frame, _ in recorded("idle", 30):
        bodies = tracker.track(frame)
        if bodies and first_ns is None:
            first_ns = frame.time_ns
            assert bodies[0].confidence.max() <= 0.6
    assert bodies[0].confidence.max() > 0.9


@pytest.mark.slow
def test_a_floor_that_appears_under_a_followed_person_is_found_within_a_second():
    """Until then, the pose is that of the settings, and legs have low confidence."""
    recording = recorded("idle", 70)
    with SyntheticSensor(choreography="idle", width=HALF, realtime=False) as sensor:
        true = sensor.read().world_from_camera
    tracker = Tracker(TrackerSettings(scene=SceneSettings(height=1.6)))
    for i, (frame, _) in enumerate(recording):
        depth = frame.depth.copy()
        if i < 30:
            points = unproject_depth(depth, pixel_rays(frame.intrinsics)) @ true[:3, :3].T + true[:3, 3]
            depth[(points[..., 1] < 0.1) | (points[..., 2] < -3.6)] = 0
        bodies = tracker.track(dataclasses.replace(frame, depth=depth))
        if i == 29:
            assert bodies and not tracker.state.floor_known
            assert bodies[0].confidence[[Joint.KNEE_LEFT, Joint.ANKLE_RIGHT, Joint.FOOT_LEFT]].max() <= 0.5
    assert tracker.state.floor_known
    np.testing.assert_allclose(tracker.world_from_camera[:3, :3], true[:3, :3], atol=0.01)
    assert tracker.world_from_camera[1, 3] == pytest.approx(true[1, 3], abs=0.02)
    (body,) = bodies
    assert np.linalg.norm(body.joints - recording[-1][1].joints, axis=1).mean() < 0.12
    assert body.confidence[Joint.ANKLE_LEFT] > 0.5


def test_moved_sensor_relearns_the_background():
    """Otherwise the old background would hide the nearer person, or the new background would count as
    people.
    """
    recording = recorded("idle", 20)
    near, far = (world_from_level_camera(1.15, np.deg2rad(5)) for _ in range(2))
    far[:3, 3] += (1.0, 0.0, 0.5)
    tracker = Tracker()
    for i, (frame, _) in enumerate(recording):
        bodies = tracker.track(dataclasses.replace(frame, world_from_camera=near if i < 10 else far))
        assert len(bodies) == 1 or i % 10 < APPEARS
    (body,) = bodies
    assert body.joints[Joint.HIP_CENTER, 0] == pytest.approx(1.0, abs=0.15)


@pytest.mark.slow
def test_returning_person_is_found_again():
    """The wall behind the person is first visible when they leave. It must not become a person."""
    recording = recorded("idle", 30)
    room = room_alone(recording[0][0])
    tracker = Tracker()
    for n, (frame, _) in enumerate(recording[:10]):
        assert tracker.track(frame) or n < APPEARS
    for i in range(10):
        bodies = tracker.track(dataclasses.replace(room, time_ns=recording[10 + i][0].time_ns))
    assert bodies == []
    tracked = [tracker.track(frame) for frame, _ in recording[20:]]
    error = errors(tracked[APPEARS:], [truth for _, truth in recording[20 + APPEARS :]])
    assert not np.isnan(error).any()
    assert error.mean() < 0.06


def room_alone(frame: DepthFrame) -> DepthFrame:
    """Returns the same sensor's view without people."""
    with SyntheticSensor(choreography="idle", width=HALF, realtime=False) as sensor:
        mount = sensor.read().world_from_camera
    depth, _ = cast_room(frame.intrinsics, mount)
    millimetres = np.where(np.isfinite(depth) & (depth < 4.0), depth * 1000, 0)
    return dataclasses.replace(frame, depth=millimetres.astype(np.uint16))


@pytest.mark.parametrize("value", [0, 65535, 1, 2000])
def test_empty_frames_give_no_bodies(value):
    """The images contain only 0, only 65535, a hand on the lens, or a wall."""
    tracker = Tracker()
    intrinsics = Intrinsics(160, 120, 130, 130, 79.5, 59.5)
    for i in range(8):
        frame = DepthFrame(np.full((120, 160), value, np.uint16), intrinsics, i * 33_333_333, "test")
        assert tracker.track(frame) == []


def test_noise_gives_only_finite_output():
    random = np.random.default_rng(0)
    tracker = Tracker()
    intrinsics = Intrinsics(160, 120, 130, 130, 79.5, 59.5)
    for i in range(5):
        depth = random.integers(0, 65536, (120, 160)).astype(np.uint16)
        for body in tracker.track(DepthFrame(depth, intrinsics, i * 33_333_333, "test")):
            assert np.isfinite(body.joints).all()


def test_a_bad_frame_between_good_ones_does_not_lose_the_person():
    recording = recorded("idle", 16)
    tracker = Tracker()
    for i, (frame, _) in enumerate(recording):
        if i == 8:
            frame = dataclasses.replace(frame, depth=np.zeros_like(frame.depth))
        bodies = tracker.track(frame)
        if i > 11:
            assert bodies


def test_changed_resolution_still_gives_bodies():
    recording = recorded("idle", 2 * APPEARS + 1)
    tracker = Tracker()
    for frame, _ in recording[:APPEARS]:
        tracker.track(frame)
    for frame, _ in recording[APPEARS:]:
        half = dataclasses.replace(
            frame, depth=frame.depth[::2, ::2].copy(), intrinsics=frame.intrinsics.scale(0.5)
        )
        bodies = tracker.track(half)
    assert bodies


def test_smoothing_off_gives_the_fit_itself():
    recording = recorded("idle", APPEARS + 2)
    tracker = Tracker(TrackerSettings(smoothing=SmoothingSettings(amount=0.0)))
    for frame, _ in recording:
        bodies = tracker.track(frame)
    (body,) = bodies
    np.testing.assert_array_equal(body.joints, tracker.posture.joints())


def test_confidence_is_low_for_missing_depth():
    """The depth of the legs is missing. The feet must have low confidence, the head high confidence."""
    recording = recorded("idle", 12)
    tracker = Tracker()
    for frame, _ in recording:
        cut = frame.depth.copy()
        cut[150:] = 0
        bodies = tracker.track(dataclasses.replace(frame, depth=cut))
    assert bodies
    confidence = bodies[0].confidence
    assert confidence[Joint.HEAD] > 0.8
    assert max(confidence[Joint.FOOT_LEFT], confidence[Joint.FOOT_RIGHT]) < 0.7
