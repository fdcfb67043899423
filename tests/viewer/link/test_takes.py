"""Tests of reading an edge's recording: poses, bodies and cues, in order of time."""

from __future__ import annotations

import warnings
from pathlib import Path

import msgspec
import numpy as np
import pytest

from enliven import cactus_project, export
from enliven.document.character import Character, Pose
from enliven.errors import InputError
from enliven.exporters import sample_performance
from enliven.person.body import Body
from enliven.recording import Recorder, Recording
from enliven.wire.convert import bodies_to_message, cues_to_message, pose_to_message
from enliven.wire.convert_characters import character_to_message
from enliven.wire.posecode import PoseCodec
from enliven_viewer.link.take_feed import TakeFeed
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.timeline import NS_PER_S, Timeline

COUNT = 40


def shifted(character: Character, k: int) -> Pose:
    rest = character.rest_pose(k * NS_PER_S // 30)
    moved = rest.positions + np.array([0.01 * k, 0, 0], np.float32)
    return Pose(rest.character, rest.time_ns, rest.linear, moved)


def write(path: Path, character: Character, *, broken: int | None = None, poses: bool = True) -> None:
    """Writes a recording of a box that is pushed along and possessed from the 20th pose on."""
    codec = PoseCodec(character)
    with Recorder(path) as recorder:

        def put(topic: str, message: object, time_ns: int) -> None:
            data = msgspec.msgpack.encode(message)
            recorder.write(topic, f"enliven.{topic}", "{}", "jsonschema", "msgpack", data, time_ns)

        put("character", character_to_message(character, 1), 0)
        for k in range(COUNT if poses else 0):
            pose = shifted(character, k)
            put(
                "bodies",
                bodies_to_message([Body(3, np.full((20, 3), 0.1), np.ones(20))], pose.time_ns),
                pose.time_ns,
            )
            if k == broken:
                put("pose", ["not", "a", "pose"], pose.time_ns)
            else:
                put("pose", pose_to_message(pose, codec, revision=1), pose.time_ns)
            state = "possessed" if k >= 20 else "free"
            put(
                "cues",
                cues_to_message(
                    character.id, state, np.array([0, 2]), np.array([1.0, 0.5]), time_ns=pose.time_ns
                ),
                pose.time_ns,
            )


def read(path: Path) -> tuple[Document, TakeFeed]:
    document, take = Document(Timeline(bounded=False)), TakeFeed(path)
    for _ in range(1000):
        if not take.poll(document):
            return document, take
    raise AssertionError("the take never ends")


def test_all_messages_are_read_in_order(tmp_path, box) -> None:
    write(tmp_path / "take.mcap", box)
    document, take = read(tmp_path / "take.mcap")
    timeline = document.timeline
    assert list(document.characters) == ["box"] and len(timeline) == COUNT and take.unreadable == 0
    for k in (0, 17, COUNT - 1):
        moment = timeline.find_moment(k * NS_PER_S // 30)
        assert np.abs(moment.poses["box"].positions - shifted(box, k).positions).max() < 2e-3
        assert moment.bodies[0].id == 3 and moment.possessed == (k >= 20)
    assert document.edge.phase == "ended"


def test_only_the_broken_message_is_lost(tmp_path, box, caplog) -> None:
    write(tmp_path / "take.mcap", box, broken=5)
    document, take = read(tmp_path / "take.mcap")
    assert take.unreadable == 1 and "cannot be read" in caplog.text
    assert len(document.timeline) == COUNT
    assert not document.timeline._moments[5].poses


def test_recording_without_a_performance_is_reported(tmp_path, box) -> None:
    write(tmp_path / "take.mcap", box, poses=False)
    with pytest.raises(InputError, match=r"no performance.*enliven run"):
        TakeFeed(tmp_path / "take.mcap")


def test_invalid_recording_is_reported(tmp_path) -> None:
    (tmp_path / "foreign.mcap").write_bytes(b"not at all")
    for name in ("foreign.mcap", "missing.mcap"):
        with pytest.raises(InputError):
            TakeFeed(tmp_path / name)


def with_copies(path: Path, character: Character) -> None:
    """Writes a recording that repeats its character in the middle and at the end, with one message per
    chunk.
    """
    codec = PoseCodec(character)
    with Recorder(path, sync_seconds=0.0) as recorder:

        def put(topic: str, message: object, time_ns: int) -> None:
            data = msgspec.msgpack.encode(message)
            recorder.write(topic, f"enliven.{topic}", "{}", "jsonschema", "msgpack", data, time_ns)

        put("character", character_to_message(character, 1), 0)
        for k in range(COUNT):
            pose = shifted(character, k)
            put("pose", pose_to_message(pose, codec, revision=1), pose.time_ns)
            if k in (COUNT // 2, COUNT - 1):
                put("character", character_to_message(character, 1), pose.time_ns)


@pytest.mark.parametrize("damaged", [(), (0,), (0, 1), (2,), (1, 2)])
def test_poses_are_read_by_any_copy_of_their_character(tmp_path, box, damaged) -> None:
    path = tmp_path / "take.mcap"
    with_copies(path, box)
    refs = sorted(Recording(path)._container.chunks, key=lambda ref: ref.offset)
    copies = [refs[0], refs[COUNT // 2 + 2], refs[-1]]
    data = bytearray(path.read_bytes())
    for k in damaged:
        data[copies[k].offset + copies[k].length // 2] ^= 0x55
    path.write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        document, take = read(path)
    assert len(document.timeline) == COUNT and take.unreadable == 0
    assert all("box" in moment.poses for moment in document.timeline._moments)


def test_take_without_its_character_is_reported_once_and_ends(tmp_path, box, caplog) -> None:
    path = tmp_path / "take.mcap"
    with_copies(path, box)
    refs = sorted(Recording(path)._container.chunks, key=lambda ref: ref.offset)
    data = bytearray(path.read_bytes())
    for ref in (refs[0], refs[COUNT // 2 + 2], refs[-1]):
        data[ref.offset + ref.length // 2] ^= 0x55
    path.write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        document, take = read(path)
    assert take.unreadable == COUNT and not document.characters
    assert caplog.text.count("cannot be read") == 1


@pytest.mark.slow
def test_exported_recording_is_played(tmp_path: Path) -> None:
    path = tmp_path / "cactus.mcap"
    export(cactus_project(), path, end=1.0, rate=10.0)
    feed, document = TakeFeed(path), Document()
    while feed.poll(document):
        pass
    assert list(document.characters) == ["cactus"] and feed.unreadable == 0
    performance = sample_performance(cactus_project(), "cactus", end=1.0, rate=10.0)
    moments = [document.timeline.find_moment(round(time * 1e9)) for time in performance.times]
    for moment, pose in zip(moments, performance.poses(), strict=True):
        np.testing.assert_allclose(moment.poses["cactus"].positions, pose.positions, atol=1e-3)
