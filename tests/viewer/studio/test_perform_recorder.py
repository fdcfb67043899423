"""Tests of the window's recorder if the clock of the stage restarts."""

from __future__ import annotations

import numpy as np
import pytest

from enliven.person.body import Body
from enliven.wire import BODIES, HOLDS, POSE, HoldMessage
from enliven_viewer.link.received_data import ReceivedBodies, ReceivedPose
from enliven_viewer.studio.features.perform.recorder import LiveRecorder

STEP = 33_333_333


def frame(step: int) -> ReceivedBodies:
    return ReceivedBodies("edge", step * STEP, 0, (Body(1, np.zeros((20, 3)), np.ones(20)),))


def hear(recorder: LiveRecorder, *steps: int) -> None:
    for step in steps:
        recorder.record(BODIES, frame(step))


@pytest.mark.parametrize("later", [0, 500], ids=["from 0", "hours on"])
def test_a_recording_begun_right_after_a_restart_counts_by_the_new_clock(later: int) -> None:
    recorder = LiveRecorder()
    hear(recorder, *range(100, 130))
    recorder.handle_restart()
    recorder.begin("take 1", delay_ns=2 * STEP)
    assert recorder.seconds == 0.0
    hear(recorder, later)
    assert recorder.seconds == 0.0, "one frame is no second, whatever the old clock said"
    hear(recorder, *range(later + 1, later + 33))
    assert recorder.seconds == pytest.approx(30 / 30, abs=1e-6)
    recorded = recorder.end()
    assert recorded.since_ns == (later + 2) * STEP
    assert [taken.time_ns // STEP for taken in recorded.frames] == list(range(later, later + 33))


def test_restart_while_recording_keeps_only_the_earlier_part() -> None:
    recorder = LiveRecorder()
    hear(recorder, 7)
    recorder.begin("take 1")
    hear(recorder, 8, 9)
    recorder.handle_restart()
    assert recorder.is_cut_short
    hear(recorder, 10, 11)
    assert [taken.time_ns // STEP for taken in recorder.end().frames] == [7, 8, 9]


def test_a_hold_from_before_the_recording_is_kept_with_the_frames_since() -> None:
    recorder = LiveRecorder()
    hear(recorder, 0, 1)
    recorder.record(HOLDS, HoldMessage("chair", 1 * STEP, "alone", body=1, holders=[1]))
    hear(recorder, 2, 3)
    recorder.begin("take 1")
    hear(recorder, 4)
    recorded = recorder.end()
    assert recorded.since_ns == 3 * STEP and [event.mode for event in recorded.events] == ["alone"]
    assert [taken.time_ns // STEP for taken in recorded.frames] == [1, 2, 3, 4]


def test_topic_bursts_after_a_slow_frame_do_not_end_the_recording(box) -> None:
    """Three seconds of performers, and then three seconds of poses, arrive in one frame."""
    recorder = LiveRecorder()
    recorder.record(HOLDS, HoldMessage("box", 0, "alone", body=1, holders=[1]))
    hear(recorder, 0)
    recorder.begin("take 1")
    hear(recorder, *range(1, 91))
    for step in range(1, 91):
        pose = box.rest_pose(step * STEP)
        recorder.record(POSE, ReceivedPose(pose, "edge", step, 0, 0, 0, 0, box, 1))
    hear(recorder, 91)
    assert not recorder.is_cut_short and recorder.holders.current_holders
    kept = recorder.end()
    assert len(kept.frames) == 92 and len(kept.poses["box", 1]) == 90
