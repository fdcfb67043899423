"""Tests of takes read from recordings: one for each visit of each person, directly from the file."""

import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest

from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.frames import BodyFrame, DepthFrame
from enliven.motion_clips.tracked_people import TakeSettings, clips_of_frames, read_recorded_clips
from enliven.person import BODY_NAMES
from enliven.person.body import Body
from enliven.recording import Recorder
from enliven.rotation import from_rotation_vector, rotate
from enliven.wire import bodies_to_message

sys.path.insert(0, str(Path(__file__).parent))
from test_capture_clip import STANDING, joints_of

RATE = 30


def waving(id: int, seconds: float) -> Body:
    """Returns a person whose left arm swings."""
    joints = STANDING.copy()
    arm = from_rotation_vector([-np.sin(3 * seconds), 0, 0])
    joints[5:8] = joints[4] + rotate(arm, STANDING[5:8] - STANDING[4])
    joints[:, 0] += id
    return Body(id, joints, np.ones(20))


def frame(seconds: float, *ids: int) -> BodyFrame:
    return BodyFrame([waving(id, seconds) for id in ids], 5_000_000_000 + round(seconds * 1e9), "kinect")


def test_a_recording_is_a_take_of_each_visit(tmp_path):
    # Person 1 is always present. Person 2 is absent for a second.
    path = tmp_path / "dance.mcap"
    with Recorder(path) as recorder:
        for i in range(4 * RATE):
            away = 45 <= i < 75
            recorder.write_frame(frame(i / RATE, *([1] if away else [1, 2])))
    clips = read_recorded_clips(path)
    assert [clip.id for clip in clips] == ["dance 1", "dance 2", "dance 3"]
    assert [clip.duration for clip in clips] == pytest.approx([119 / RATE, 44 / RATE, 44 / RATE], abs=0.04)
    assert all(clip.skeleton.names == BODY_NAMES for clip in clips)
    at = joints_of(clips[0])
    for i in (0, 10, 100):
        np.testing.assert_allclose(at[i], waving(1, i / RATE).joints, atol=1e-5)
    assert clips[2].root[0, 0] == pytest.approx(2.0)


def test_one_person_gives_the_take_its_name_and_a_short_gap_is_bridged():
    frames = [frame(i / RATE, 1) for i in range(60) if i not in (20, 21, 22)]
    frames.insert(10, frames[9])  # the same time twice
    (clip,) = clips_of_frames(frames, "solo", TakeSettings())
    assert clip.id == "solo" and len(clip.turns) == 60
    np.testing.assert_allclose(joints_of(clip)[21], waving(1, 21 / RATE).joints, atol=0.01)


def test_passer_by_is_not_a_take(tmp_path):
    path = tmp_path / "empty.mcap"
    with Recorder(path) as recorder:
        for i in range(5):
            recorder.write_frame(frame(i / RATE, 1))
    with pytest.raises(InputError, match="no performer is in the recording"):
        read_recorded_clips(path)
    assert len(read_recorded_clips(path, settings=TakeSettings(shortest=0.1))) == 1


def test_published_bodies_become_a_take(tmp_path):
    """Bodies of a recorded performance are those of the wire, accurate to a millimetre or two."""
    path = tmp_path / "show.mcap"
    with Recorder(path) as recorder:
        for i in range(60):
            moment = frame(i / RATE, 1)
            message = msgspec.msgpack.encode(bodies_to_message(moment.bodies, moment.time_ns))
            recorder.write("bodies", "BodiesMessage", "{}", "jsonschema", "msgpack", message, moment.time_ns)
        recorder.write("bodies", "BodiesMessage", "{}", "jsonschema", "msgpack", b"damaged", 10**10)
    (clip,) = read_recorded_clips(path)
    assert clip.id == "show" and len(clip.turns) == 60
    np.testing.assert_allclose(joints_of(clip)[30], waving(1, 30 / RATE).joints, atol=2e-3)


def test_depth_is_sent_to_the_tracker(tmp_path):
    path = tmp_path / "room.mcap"
    with Recorder(path) as recorder:
        recorder.write_frame(
            DepthFrame(np.zeros((4, 6), np.uint16), Intrinsics(6, 4, 5, 5, 3, 2), 0, "kinect")
        )
    with pytest.raises(InputError, match=r"enliven track room\.mcap"):
        read_recorded_clips(path)
