"""Tests of the monitor's times, images and alarms: each problem is reported once and then cleared."""

import dataclasses
import logging

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.camera import Intrinsics, world_from_level_camera
from enliven.frames import BodyFrame, DepthFrame
from enliven.health import HealthKind, Severity
from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven_edge.tracking.frame.frame_check import FrameTiming
from enliven_edge.tracking.frame.reduction import measure_depth_image
from enliven_edge.tracking.health.alarm import HEALTH_MESSAGES, Alarm, Alarms
from enliven_edge.tracking.health.health import HealthMonitor, HealthSettings, TrackerState

STEP = 33_333_333
CAMERA = Intrinsics(160, 120, 130, 130, 79.5, 59.5)
LEFT_MISSING = (np.arange(160) >= 64).astype(np.uint16)
MOUNT = world_from_level_camera(1.2)


def image(number: int, missing: float = 0.0) -> np.ndarray:
    random = np.random.default_rng(number)
    depth = random.integers(2000, 2100, (120, 160)).astype(np.uint16)
    depth[random.random(depth.shape) < missing] = 0
    return depth


def frame(number: int, time_ns: int | None = None, depth: np.ndarray | None = None) -> DepthFrame:
    depth = image(number) if depth is None else depth
    return DepthFrame(depth, CAMERA, number * STEP if time_ns is None else time_ns, "test")


def kinds(monitor: HealthMonitor) -> set[str]:
    return {state.kind for state in monitor.states}


def standing(distance: float = 3.0, aside: float = 0.0, identity: int = 1) -> Body:
    """Returns a person that stands straight in front of the sensor."""
    joints = np.zeros((20, 3))
    joints[:, 1] = 0.95
    joints[Joint.HEAD, 1] = 1.6
    joints[[Joint.FOOT_LEFT, Joint.FOOT_RIGHT], 1] = 0.05
    joints += (aside, 0.0, -distance)
    return Body(identity, joints, np.full(20, 0.9))


# --- times -------------------------------------------------------------------------------------------------


@given(st.lists(st.integers(1, 40), min_size=1, max_size=60), st.randoms())
@settings(deadline=None)
def test_accepted_frames_have_increasing_times(steps, random):
    """For any order of times within a second."""
    times = np.cumsum(steps).tolist()
    shuffled = sorted(times, key=lambda t: t + random.choice([0, 0, 0, 30]))
    rhythm, seen = FrameTiming(), [0]
    for each in shuffled:
        if rhythm.admit(each) and each < seen[-1]:
            assert len(rhythm._late_times) == 0  # the clock was set back: three late frames in a row
        elif each > seen[-1]:
            seen.append(each)
    assert rhythm.admit(times[-1] + 10_000)


def test_a_late_frame_is_left_out_and_counted_and_a_clock_that_was_set_back_is_taken():
    rhythm = FrameTiming()
    assert all(rhythm.admit(t * STEP) for t in range(10, 20))
    assert not rhythm.admit(12 * STEP) and rhythm.late == 1
    assert not rhythm.admit(19 * STEP) and rhythm.repeated == 1
    assert rhythm.admit(20 * STEP)
    assert [rhythm.admit(t * STEP) for t in range(5)] == [False, False, True, True, True]


@pytest.mark.parametrize("fps", [5.0, 15.0, 30.0, 90.0])
def test_the_rate_is_that_of_the_times(fps):
    rhythm = FrameTiming()
    for i in range(40):
        rhythm.admit(round(i * 1e9 / fps))
    assert rhythm.rate == pytest.approx(fps, rel=0.01) and rhythm.lost_fraction == pytest.approx(
        0.0, abs=0.01
    )


@pytest.mark.parametrize("lost", [0.1, 0.3, 0.5])
def test_lost_frames_are_counted_by_their_gaps(lost):
    rhythm, random = FrameTiming(), np.random.default_rng(0)
    for i in range(400):
        if random.random() > lost:
            rhythm.admit(i * STEP + int(random.normal(0, 1e6)))
    assert rhythm.lost_fraction == pytest.approx(lost, abs=0.15)


# --- images ------------------------------------------------------------------------------------------------


def test_a_survey_counts_as_the_slow_way_does():
    depth = image(0, missing=0.3)
    depth[:10], depth[10:20] = 100, 65535
    surveyed = measure_depth_image(depth)
    is_known = (depth != 0) & (depth != 65535)
    assert surveyed.known_fraction == pytest.approx(is_known.mean())
    assert surveyed.usable_fraction == pytest.approx((is_known & (depth >= 300)).mean())
    holes = ~is_known[:, 1:-1] & is_known[:, :-2] & is_known[:, 2:]
    assert surveyed.speckle_fraction == pytest.approx(holes.sum() / depth.size)


def test_the_mark_tells_images_apart_and_knows_the_same_one():
    marks = [measure_depth_image(image(i)).image_hash for i in range(50)]
    assert len(set(marks)) == 50 and measure_depth_image(image(3)).image_hash == marks[3]


# --- alarms ------------------------------------------------------------------------------------------------


@given(st.lists(st.booleans(), max_size=60), st.floats(0, 1), st.floats(0, 1))
def test_an_alarm_changes_no_sooner_than_it_may(wrong, raise_after, clear_after):
    alarm, before, since = Alarm(raise_after, clear_after), False, 0
    for i, each in enumerate(wrong):
        now = i * 100_000_000
        if i == 0 or each != wrong[i - 1]:
            since = now
        active = alarm.update(each, now)
        if active != before:
            assert active == each
            assert now - since >= int((raise_after if active else clear_after) * 1e9)
        before = active


def test_every_kind_has_its_sentence_and_what_to_do():
    assert set(HEALTH_MESSAGES) == set(HealthKind)
    for message in HEALTH_MESSAGES.values():
        assert message.what.endswith(".") and message.remedy.endswith(".")
        assert len(message.what) < 120 and len(message.remedy) < 120


# --- the monitor -------------------------------------------------------------------------------------------


def watched(monitor: HealthMonitor, frames) -> list[set[str]]:
    """Returns the problems after each frame."""
    reported = []
    for each in frames:
        if monitor.admit(each):
            monitor.check_result(each, [standing()], MOUNT, TrackerState())
        reported.append(kinds(monitor))
    return reported


def test_a_good_stream_is_in_good_health():
    assert watched(HealthMonitor(), [frame(i) for i in range(90)]) == [set()] * 90


@pytest.mark.parametrize(
    ("kind", "fault"),
    [
        (HealthKind.SLOW, lambda i: frame(i) if i % 6 == 0 else None),
        (HealthKind.DROPPED, lambda i: None if i % 3 == 0 else frame(i)),
        (HealthKind.OUT_OF_ORDER, lambda i: frame(i - 5) if i % 7 == 0 else frame(i)),
        (HealthKind.FROZEN, lambda i: frame(i, depth=image(0))),
        (HealthKind.FROZEN, lambda i: frame(99, depth=image(i))),
        (HealthKind.COVERED, lambda i: frame(i, depth=np.zeros((120, 160), np.uint16))),
        (HealthKind.COVERED, lambda i: frame(i, depth=image(i) // 20)),
        (HealthKind.MISSING_DEPTH, lambda i: frame(i, depth=image(i, 0.4))),
        (HealthKind.MISSING_DEPTH, lambda i: frame(i, depth=image(i) * LEFT_MISSING)),
    ],
)  # fmt: skip
def test_sensor_fault_is_reported_and_cleared(kind, fault):
    """The fault lasts three seconds. Nothing else is reported, and the report does not flicker."""
    monitor = HealthMonitor()
    assert watched(monitor, [frame(i) for i in range(100)])[-1] == set()
    reported = watched(monitor, [f for f in (fault(i) for i in range(100, 220)) if f is not None])
    assert kind in reported[-1], reported[-1]
    last = monitor.states[0]
    assert last.since_ns >= 95 * STEP and last.what.endswith(".") and last.remedy.endswith(".")
    after = watched(monitor, [frame(i) for i in range(220, 340)])
    assert after[-1] == set()
    active = [kind in each for each in reported + after]
    assert np.abs(np.diff(np.array(active, int))).sum() == 2


def test_silent_sensor_is_reported():
    monitor = HealthMonitor()
    watched(monitor, [frame(i) for i in range(5)])
    monitor.record_silence(0.2)
    assert kinds(monitor) == set()
    monitor.record_silence(3.0)
    (state,) = monitor.states
    assert (state.kind, state.severity) == (HealthKind.NO_FRAMES, Severity.ERROR) and "3 s" in state.what
    assert watched(monitor, [frame(6)]) == [set()]


@pytest.mark.parametrize(
    ("kind", "body"),
    [
        (HealthKind.TOO_NEAR, standing(0.7)),
        (HealthKind.TOO_FAR, standing(4.4)),
        (HealthKind.CUT_OFF, standing(3.0, aside=2.2)),
        (HealthKind.CUT_OFF, standing(1.6)),
        (HealthKind.UNCLEAR, dataclasses.replace(standing(), confidence=np.full(20, 0.2))),
    ],
)
def test_bad_performer_position_is_reported_with_the_performer(kind, body):
    monitor, good = HealthMonitor(), standing(identity=2, aside=-0.7)
    for i in range(60):
        monitor.admit(frame(i))
        monitor.check_result(frame(i), [body, good], MOUNT, TrackerState())
    assert (kind, 1) in {(s.kind, s.performer) for s in monitor.states}
    assert {s.performer for s in monitor.states} == {1}
    assert all("Performer 1" in s.what for s in monitor.states)
    monitor.admit(frame(60))
    monitor.check_result(frame(60), [good], MOUNT, TrackerState())
    assert monitor.states == [], "who is gone is not complained of"


@pytest.mark.parametrize(
    ("kind", "state"),
    [
        (HealthKind.NO_FLOOR, TrackerState(floor_known=False)),
        (HealthKind.LEARNING_ROOM, TrackerState(room_age=0.5)),
        (HealthKind.MOVED, TrackerState(moved=True)),
        (HealthKind.JOINED, TrackerState(joined=(4, 2))),
    ],
)
def test_trackers_own_warnings_are_forwarded(kind, state):
    monitor = HealthMonitor(name="left")
    for i in range(60):
        monitor.admit(frame(i))
        monitor.check_result(frame(i), [], MOUNT, state)
    (warning,) = monitor.states
    assert warning.kind == kind
    for i in range(60, 180):
        monitor.admit(frame(i))
        monitor.check_result(frame(i), [], MOUNT, TrackerState())
    assert monitor.states == []


def test_people_holding_hands_are_reported_as_joined():
    monitor, ada, bob = HealthMonitor(), standing(aside=-0.5), standing(aside=0.5, identity=4)
    for i in range(90):
        hand = np.array([0.0, 0.9, -3.0 if i < 45 else -2.5])
        ada.joints[Joint.HAND_LEFT] = hand
        bob.joints[Joint.HAND_RIGHT] = [0.05, 0.9, -3.0]
        monitor.admit(frame(i))
        monitor.check_result(frame(i), [ada, bob], MOUNT, TrackerState())
        if i == 44:
            (warning,) = monitor.states
            assert warning.kind == HealthKind.JOINED and "1 and 4" in warning.what
    assert monitor.states == []


def test_each_trouble_is_logged_once_and_so_is_its_end(caplog):
    caplog.set_level(logging.INFO)
    monitor = HealthMonitor()
    nothing = np.zeros((120, 160), np.uint16)
    watched(monitor, [frame(i, depth=nothing if 30 <= i < 60 else None) for i in range(120)])
    assert [record.levelname for record in caplog.records] == ["WARNING", "INFO"]
    assert "covered" in caplog.text


def test_frames_of_sensors_that_track_people_themselves_are_judged_by_their_times():
    monitor = HealthMonitor()
    for i in range(60):
        each = BodyFrame([standing()], i * 6 * STEP, "kinect")
        assert monitor.admit(each)
        monitor.check_result(each, each.bodies)
    assert kinds(monitor) == {HealthKind.SLOW}


def test_a_sensor_may_promise_less():
    monitor = HealthMonitor(HealthSettings(), fps=5.0)
    assert watched(monitor, [frame(i) for i in range(0, 300, 6)])[-1] == set()


@pytest.mark.parametrize("kind", HealthKind)
def test_sensor_without_a_device_gets_no_hardware_advice(kind: HealthKind) -> None:
    alarms = Alarms("The sensor")
    numbers = ("rate", "promised", "percent", "count", "seconds", "degrees", "celsius", "metres", "limit")
    facts: dict[str, object] = dict.fromkeys(numbers, 1.0)
    words_of_facts = ("names", "why", "remedy", "link", "side", "what", "path", "output")
    facts |= dict.fromkeys(words_of_facts, "Check its cable")
    words = {}
    for is_device in (True, False):
        alarms.is_device = is_device
        alarms.update(kind, True, 0, **facts)
        alarms.update(kind, True, 10**11, **facts)
        words[is_device] = " ".join(state.remedy for state in alarms.states)
    assert words[True] and words[False]
    for word in ("cable", "USB", "plug", "power", "lens"):
        assert word.lower() not in words[False].lower(), words[False]
