"""Tests of bad input from end to end: a real stream with a fault between good parts.

No exception may be raised, the monitor must report the fault, and tracking must continue afterwards.
"""

import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest

from enliven.frames import DepthFrame
from enliven.health import HealthKind
from enliven_edge.tracking.health.health import HealthMonitor
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.sensor.synthetic import SyntheticSensor

GOOD, BAD, AFTER = 45, 60, 75
"""Number of frames before, during and after a fault. The person is known before it, and found again after
it.
"""
WIDTH = 200
"""Image width in pixels, less than a third of the sensor's. People are tracked at half of this width."""


def stream() -> Iterator[tuple[DepthFrame, np.ndarray]]:
    """Returns a walking person with the true joints. The frames do not state the sensor's pose."""
    with SyntheticSensor(choreography="walk", width=WIDTH, realtime=False) as sensor:
        for _ in range(GOOD + BAD + AFTER):
            frame = sensor.read()
            truth = sensor.truth(frame.time_ns).joints
            yield dataclasses.replace(frame, world_from_camera=None), truth


@pytest.fixture(scope="module")
def frames() -> list[tuple[DepthFrame, np.ndarray]]:
    return list(stream())


def run(faulty) -> tuple[list[set[str]], list[float], Tracker]:
    """Returns the problems after each frame, and the body's mean error in metres (NaN without a body)."""
    monitor, tracker = HealthMonitor(fps=30.0), Tracker()
    reported, errors = [], []
    for frame, truth in faulty:
        if monitor.admit(frame):
            bodies = tracker.track(frame)
            monitor.check_result(frame, bodies, tracker.world_from_camera, tracker.state)
            for body in bodies:
                assert np.isfinite(body.joints).all() and np.isfinite(body.orientations).all()
            error = np.linalg.norm(bodies[0].joints - truth, axis=1).mean() if bodies else np.nan
            errors.append(float(error))
        reported.append({state.kind for state in monitor.states})
    return reported, errors, tracker


def faulty(frames, fault, good=GOOD):
    """Yields the stream with the fault after some good frames. A fault maps each frame to frames."""
    for i, (frame, truth) in enumerate(frames):
        if good <= i < good + BAD:
            for each in fault(i - good, frame):
                yield each, truth
        else:
            yield frame, truth


def without(frame: DepthFrame, share: float, seed: int) -> DepthFrame:
    holes = np.random.default_rng(seed).random(frame.depth.shape) < share
    return dataclasses.replace(frame, depth=np.where(holes, 0, frame.depth).astype(np.uint16))


def dark(frame: DepthFrame) -> DepthFrame:
    return dataclasses.replace(frame, depth=np.zeros_like(frame.depth))


FAULTS = {
    HealthKind.DROPPED: lambda i, frame: [] if i % 3 == 0 else [frame],
    HealthKind.SLOW: lambda i, frame: [frame] if i % 6 == 0 else [],
    HealthKind.OUT_OF_ORDER: lambda i, frame: [
        dataclasses.replace(frame, time_ns=frame.time_ns - (200_000_000 if i % 4 == 2 else 0))
    ],
    HealthKind.MISSING_DEPTH: lambda i, frame: [without(frame, 0.4, i)],
    HealthKind.COVERED: lambda i, frame: [dark(frame)],
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", FAULTS)
def test_fault_is_reported_and_tracking_resumes(frames, kind):
    reported, errors, _ = run(faulty(frames, FAULTS[kind]))
    assert kind not in reported[GOOD - 1]
    assert kind in set().union(*reported[GOOD:-AFTER])
    assert kind not in reported[-1]
    last = errors[-20:]
    assert not np.isnan(last).any(), "the person was not found again"
    assert np.mean(last) < 0.07


@pytest.mark.slow
@pytest.mark.parametrize("good", [20, 35, GOOD])
def test_frozen_sensor_is_reported_and_its_last_image_is_harmless(frames, good):
    """Two seconds later, the person is half a metre nearer and hides that position, or is behind it."""
    still = frames[good - 1][0].depth
    frozen = lambda i, frame: [dataclasses.replace(frame, depth=still)]  # noqa: E731
    reported, errors, tracker = run(faulty(frames, frozen, good))
    assert HealthKind.FROZEN in reported[good + BAD - 1] and HealthKind.FROZEN not in reported[-1]
    assert max(errors[good + BAD + 10 :]) < 0.07
    assert [person.id for person in tracker.performers] == [1], "it is the same person, and no other is left"


@pytest.mark.slow
def test_stopped_clock_is_reported_and_no_frame_is_tracked_twice(frames):
    stuck = frames[GOOD - 1][0].time_ns
    reported, errors, _ = run(faulty(frames, lambda i, frame: [dataclasses.replace(frame, time_ns=stuck)]))
    assert HealthKind.FROZEN in reported[GOOD + BAD - 1] and HealthKind.FROZEN not in reported[-1]
    assert len(errors) == GOOD + AFTER
    assert np.mean(errors[-20:]) < 0.07


@pytest.mark.slow
def test_frames_out_of_order_do_not_change_the_bodies(frames):
    """Late frames are dropped, so the bodies equal those of the stream without them."""

    def late(i, frame):
        return [frame, dataclasses.replace(frames[GOOD + i - 3][0])] if i % 5 == 4 else [frame]

    _, mixed, tracker = run(faulty(frames, late))
    _, plain, other = run(iter(frames))
    assert mixed == plain
    assert [p.id for p in tracker.performers] == [p.id for p in other.performers]


@pytest.mark.slow
def test_a_stream_with_every_fault_at_once_raises_nothing(frames):
    random = np.random.default_rng(0)

    def worst(i, frame):
        choice = random.integers(6)
        if choice == 0:
            return []
        if choice == 1:
            return [dark(frame)]
        if choice == 2:
            return [dataclasses.replace(frame, time_ns=int(random.integers(0, 2**62)))]
        if choice == 3:
            noise = random.integers(0, 65536, frame.depth.shape).astype(np.uint16)
            return [dataclasses.replace(frame, depth=noise)]
        return [without(frame, float(random.random()), i), frame]

    _, errors, _ = run(faulty(frames, worst))
    assert np.mean(errors[-20:]) < 0.07


@pytest.mark.slow
@pytest.mark.parametrize(("tilt", "height"), [(30, 2.2), (20, 1.6), (10, 1.15)])
def test_moved_sensor_is_reported_and_finds_pose_and_person(frames, tilt, height):
    """The sensor's position changes from one frame to the next. The background changes, the person does
    not.
    """
    with SyntheticSensor(
        choreography="walk", width=WIDTH, realtime=False, camera_tilt=tilt, camera_height=height
    ) as sensor:
        knocked = []
        for _ in range(GOOD + BAD + AFTER):
            frame = sensor.read()
            mount = frame.world_from_camera
            truth = sensor.truth(frame.time_ns).joints
            knocked.append((dataclasses.replace(frame, world_from_camera=None), truth))
    reported, errors, tracker = run(iter([*frames[:GOOD], *knocked[GOOD:]]))
    assert HealthKind.MOVED not in set().union(*reported[:GOOD])
    assert HealthKind.MOVED in set().union(*reported[GOOD:])
    assert HealthKind.MOVED not in reported[-1]
    assert tracker.world_from_camera[1, 3] == pytest.approx(mount[1, 3], abs=0.08)
    assert np.rad2deg(np.arccos(min(1.0, tracker.world_from_camera[1, :3] @ mount[1, :3]))) < 3.0
    assert np.mean(errors[-20:]) < 0.09


@pytest.mark.slow
def test_changed_sensor_mode_relearns_background_and_finds_person(frames):
    """A single frame of another size is dropped. A lasting change of size counts as another camera."""
    with SyntheticSensor(choreography="walk", width=128, realtime=False) as sensor:
        smaller = []
        for _ in range(GOOD + BAD + AFTER):
            frame = sensor.read()
            truth = sensor.truth(frame.time_ns).joints
            smaller.append((dataclasses.replace(frame, world_from_camera=None), truth))
    mixed = [*frames[: GOOD - 9], smaller[GOOD - 9], *frames[GOOD - 8 : GOOD], *smaller[GOOD:]]
    reported, errors, tracker = run(iter(mixed))
    assert HealthKind.RESIZED in reported[GOOD - 9] and HealthKind.RESIZED in reported[GOOD]
    assert HealthKind.RESIZED not in reported[-1]
    assert len(errors) == len(mixed) - 1 - 4
    assert tracker.owner.shape[1] <= 128
    assert np.mean(errors[-20:]) < 0.09
