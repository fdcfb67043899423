"""Tests that playing a real recording through the cameras' libraries equals replaying it directly."""

import importlib.util
import os
import uuid
from pathlib import Path

import msgspec
import numpy as np
import pytest

from enliven import cli
from enliven.recording import Recorder, Recording
from enliven.wire.characters import CharacterMessage
from enliven.wire.convert import message_to_bodies, message_to_pose
from enliven.wire.convert_characters import message_to_character
from enliven.wire.posecode import PoseCodec
from enliven.wire.streams import BodiesMessage, PoseMessage
from enliven_edge.importing.base import ImportOptions
from enliven_edge.importing.registry import find_files, find_reader

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
TAKE = DATA / "depth" / "uva_cv2_person_turn"
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not TAKE.is_dir(), reason="the real recordings (ENLIVEN_DATA) are not here"),
]
FRAMES = 60
MILLIMETRE = 1e-3
"""Tolerance in metres. The wire's resolution is half of it."""
LIBRARIES = {"oak": "depthai", "realsense": "pyrealsense2"}


@pytest.fixture(scope="module")
def take(tmp_path_factory) -> Path:
    """Imports the first frames of the recording like a user."""
    path = tmp_path_factory.mktemp("rehearsal") / "real.mcap"
    paths = find_files([TAKE])
    with Recorder(path) as recorder:
        for frame, _ in zip(find_reader(paths).read(paths, ImportOptions()), range(FRAMES), strict=False):
            recorder.write_frame(frame)
    return path


def performed(output: Path, *words: str) -> tuple[list[tuple], list[tuple]]:
    """Returns (time, joints of each body) and (time, positions, transforms) published by an edge for a
    sensor's frames.
    """
    ports = ["--port", "0", "--control-port", "0", "--name", uuid.uuid4().hex[:12]]
    assert cli.run(["edge", *words, *ports, "--possess-at", "0.5", "--record", str(output)]) == 0
    take = Recording(output)
    bodies, poses, codecs = [], [], {}
    for _, data in take.messages("bodies"):
        message = msgspec.msgpack.decode(data, type=BodiesMessage)
        bodies.append((message.time_ns, np.array([body.joints for body in message_to_bodies(message)])))
    for _, data in take.messages("character"):
        character = msgspec.msgpack.decode(data, type=CharacterMessage)
        codecs[character.revision] = PoseCodec(message_to_character(character))
    for _, data in take.messages("pose"):
        sent = msgspec.msgpack.decode(data, type=PoseMessage)
        pose = message_to_pose(sent, codecs[sent.revision])
        poses.append((pose.time_ns, pose.positions, pose.linear))
    return bodies, poses


@pytest.fixture(scope="module")
def replayed(take, tmp_path_factory) -> tuple[list[tuple], list[tuple]]:
    return performed(tmp_path_factory.mktemp("replayed") / "a.mcap", "--recording", str(take), "--speed", "0")


@pytest.mark.parametrize("driver", LIBRARIES)
def test_each_body_and_each_pose_is_the_same_to_the_millimetre(driver, take, replayed, tmp_path):
    """The whole edge runs frame by frame with the chair that the person possesses. No frame is skipped."""
    if importlib.util.find_spec(LIBRARIES[driver]) is None:
        pytest.skip(f'{LIBRARIES[driver]} is not installed: pip install "./edge[{driver}]"')
    rehearsed = performed(tmp_path / "b.mcap", "--sensor", driver, "--set", f"rehearse={take}")
    assert len(rehearsed[0]) == FRAMES and max(len(joints) for _, joints in rehearsed[0]) == 1
    places = np.array([place for _, place, _ in replayed[1]])
    assert np.ptp(places, axis=0).max() > 0.1, "the chair is moved"
    for expected, actual in zip(replayed, rehearsed, strict=True):
        assert len(expected) == len(actual)
        for (time_ns, *arrays), (other_ns, *others) in zip(expected, actual, strict=True):
            assert time_ns == other_ns
            for a, b in zip(arrays, others, strict=True):
                np.testing.assert_allclose(a, b, atol=MILLIMETRE)
