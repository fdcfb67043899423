"""Tests that real Kinect skeletons choose a part of a real spider by posing, and animate it."""

import os
import uuid
from pathlib import Path

import msgspec
import numpy as np
import pytest

from enliven.matching.picking import PickingSettings
from enliven.matching.views import ScreenView
from enliven.motion_clips.joint_positions import rotations_from_positions
from enliven.person.joints import Joint
from enliven.recording import Recording
from enliven.rotation import conjugate, multiply, to_rotation_vector
from enliven.wire.matches import message_to_board
from enliven.wire.streams import MatchesMessage, PoseMessage
from enliven_edge.importing.base import ImportOptions
from enliven_edge.importing.registry import find_files, find_reader
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.rig.rig_actor import create_rig_actor
from enliven_edge.stage.rig.settings import MatchingSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker
from enliven_viewer.link.take_feed import TakeFeed
from enliven_viewer.playback.document import Document

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[4] / "shared" / "data"))
SPIDER = DATA / "gltf" / "quaternius" / "Spider.glb"
CLIPS = (
    "ms_labanotation_kinect2/Ges01*.csv",
    "ms_labanotation_kinect2/Ges06*.csv",
    "kinect_multitrack/Study_1_*.csv",
    "kinect_gait/Person001_1.txt",
    "js6450_kinect2_json/2people_*.json",
)
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not SPIDER.is_file(), reason=f"no spider in {DATA} (set ENLIVEN_DATA)"),
]


def frames_of(pattern):
    paths = find_files([str(DATA / "skeletons" / pattern)])
    return list(find_reader(paths, None).read(paths, ImportOptions()))


def tips(row):
    """Returns the limbs that a match selects, while the performers stand still."""
    return tuple(tuple(line[-1]) for line in row.lines)


def stage_of(**settings):
    actor = create_rig_actor(str(SPIDER), MatchingSettings(**settings))
    actor.preview(None, "arms")
    actor.view = ScreenView(np.array([0.0, -0.3, -1.0]))
    return Stage([actor]), actor


@pytest.mark.parametrize("pattern", CLIPS)
def test_shown_match_resembles_the_arms_without_flicker(pattern):
    stage, _ = stage_of()
    frames = [frame for frame in frames_of(pattern) if frame.bodies][:400]
    changes, raw, last, last_raw, seconds = 0, 0, None, None, frames[-1].time_ns - frames[0].time_ns
    for frame in frames:
        stage.perform(frame.bodies, frame.time_ns)
        (board,) = stage.boards()
        assert board.state == "choosing" and board.total == 45
        assert board.rows[board.shown].score >= board.rows[0].score - 2.0
        meant, best = tips(board.rows[board.shown]), tips(board.rows[0])
        changes, raw = changes + (meant != last), raw + (best != last_raw)
        last, last_raw = meant, best
    # A change takes at least the delay of 0.3 s.
    assert changes <= seconds * 1e-9 / 0.3 + 1
    assert changes <= raw


def test_the_leg_turns_as_the_arm_does():
    stage, actor = stage_of(fade=0.0)
    frames = [frame for frame in frames_of(CLIPS[0]) if frame.bodies]
    name = actor.character.id
    for frame in frames[:30]:
        stage.perform(frame.bodies, frame.time_ns)
    stage.possess(name, parts="arms")
    (hold,) = actor.holds
    rest, angles = None, []
    for frame in frames[30:]:
        (pose,) = stage.perform(frame.bodies, frame.time_ns)
        assert np.isfinite(pose.linear).all() and np.isfinite(pose.positions).all()
        rest = pose if rest is None else rest
        turns = rotations_from_positions(hold.take.skeleton, hold.joints[None])[0]
        for source, target in hold.pairs:
            arm = to_rotation_vector(multiply(conjugate(turns[Joint.SHOULDER_CENTER]), turns[source[-1]]))
            linear = pose.linear[target[-1]].astype(float)
            leg = np.arccos(np.clip((np.trace(linear) - 1) / 2, -1, 1))
            assert leg == pytest.approx(np.linalg.norm(arm), abs=2e-3), "the whole turn of the arm"
            angles.append(leg)
    assert max(angles) > 1.0, "somebody waved"
    driven = {bone for _, target in hold.pairs for bone in target[1:]}
    below = {j for bone in driven for j in actor.live_shape.shape.skeleton.list_subtree(bone)}
    others = [j for j in range(len(actor.character.pivots)) if j not in below]
    np.testing.assert_allclose(pose.linear[others], rest.linear[others], atol=1e-6)


@pytest.mark.parametrize(("pattern", "taken"), [(CLIPS[2], True), (CLIPS[0], False), (CLIPS[3], False)])
def test_a_held_pose_is_taken_and_a_gesture_or_a_walk_is_not(pattern, taken):
    stage, _ = stage_of(picking=PickingSettings(by_holding=True, still_seconds=1.0))
    states = []
    for frame in frames_of(pattern):
        stage.perform(frame.bodies, frame.time_ns)
        states.append(stage.boards()[0].state)
    assert ("playing" in states) == taken


class Played(Sensor):
    """A sensor that plays frames without waiting."""

    name = "kinect"

    def __init__(self, frames):
        self._frames = iter(frames)

    def read(self, timeout=None):
        return next(self._frames, None)

    def close(self): ...


def test_edge_plays_a_recording_and_records_the_result(tmp_path):
    _, actor = stage_of()
    wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
    with Outlet(wire, "kinect", record=tmp_path / "made.mcap") as outlet:
        outlet.introduce(actor.character)
        played = Played(frames_of(CLIPS[0]))
        Edge(played, Tracker(), Stage([actor]), outlet, possess_at=2.0, parts="arms").run()
    recording = Recording(tmp_path / "made.mcap")
    boards = [
        message_to_board(msgspec.msgpack.decode(data, type=MatchesMessage))
        for _, data in recording.messages("matches")
    ]
    document, take = Document(), TakeFeed(tmp_path / "made.mcap")
    while take.poll(document):
        pass
    assert take.unreadable == 0
    assert len(document.timeline) == len(boards)
    assert document.timeline.find_moment(boards[20].time_ns).boards[actor.character.id].state == "choosing"
    assert document.timeline.find_moment(boards[-1].time_ns).boards[actor.character.id].state == "playing"
    poses = [msgspec.msgpack.decode(data, type=PoseMessage) for _, data in recording.messages("pose")]
    first = boards[0].time_ns
    for board in boards:
        seconds = (board.time_ns - first) * 1e-9
        assert 2.0 < seconds < 2.05 or board.state == ("choosing" if seconds <= 2.0 else "playing")
    playing = [pose.transforms for pose in poses if (pose.time_ns - first) * 1e-9 > 2.5]
    assert len(set(playing)) > 0.8 * len(playing), "it moves"
    still = [pose.transforms for pose in poses if (pose.time_ns - first) * 1e-9 <= 2.0]
    assert len(set(still)) == 1, "before, it stood still"
