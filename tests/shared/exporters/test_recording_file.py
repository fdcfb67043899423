"""Tests of exported recordings (.mcap): characters, people and coordinate frames for Foxglove, in order of
time.
"""

from __future__ import annotations

import json
from dataclasses import replace

import made_puppets
import numpy as np
import pytest
from made_bodies import man, random_motion, shape_with_markers
from made_recording import write_recording
from mcap.reader import make_reader
from test_tracked_people import waving

from enliven.cli import run
from enliven.deformation.skinning import skin_vertices
from enliven.document import Project, character_of
from enliven.exporters import exporter_of, performance_of_clip, sample_performance
from enliven.formats.rig.rig import play_clip
from enliven.motion.layers.evaluate import Player
from enliven.motion_clips.recorded_characters import read_characters_and_poses
from enliven.oneshot.exportable import find_exportables
from enliven.person import Joint
from enliven.recording import Recording
from enliven.rotation import multiply, rotate

WIRE_M = 4e-3
"""Maximum error of poses on the wire, added up along a limb, metres."""
BEGIN = 7_000_000_000
"""Time of the recording's first frame on the sensor's clock, nanoseconds."""


@pytest.fixture(scope="module")
def project():
    shape = shape_with_markers("man", man())
    return play_clip(Project(), shape, random_motion(np.random.default_rng(1), shape.skeleton, name="walk"))[
        0
    ]


@pytest.fixture(scope="module")
def walk(project):
    return sample_performance(project, "man", rate=20.0)


def save(path, performances, title="walk", **options):
    exporter_of(path, **options).save(path, performances, title, **options)
    return Recording(path)


def surfaces_in(recording):
    """Returns the surfaces of each character by its name, with their times in nanoseconds."""
    characters, poses = read_characters_and_poses(recording)
    return {
        key[0]: [(pose.time_ns, skin_vertices(characters[key], pose)) for pose in own]
        for key, own in poses.items()
    }


def frames_in(path):
    """Returns Foxglove's frame transforms: (nanoseconds, parent, child, position, rotation as wxyz)."""
    with path.open("rb") as file:
        messages = [message for *_, message in make_reader(file).iter_messages(topics=["/tf"])]
    frames = []
    for message in messages:
        for frame in json.loads(message.data)["transforms"]:
            stamp = frame["timestamp"]["sec"] * 10**9 + frame["timestamp"]["nsec"]
            assert stamp == message.log_time
            place = [frame["translation"][axis] for axis in "xyz"]
            turn = np.array([frame["rotation"][axis] for axis in "wxyz"])
            frames.append((stamp, frame["parent_frame_id"], frame["child_frame_id"], place, turn))
    return frames


def test_recording_contains_every_frame_within_the_error_of_the_wire(walk, tmp_path):
    (surfaces,) = surfaces_in(save(tmp_path / "walk.mcap", [walk])).values()
    assert [time for time, _ in surfaces] == [round(time * 1e9) for time in walk.times]
    for (_, surface), expected in zip(surfaces, walk.surfaces(), strict=True):
        assert np.abs(surface - expected).max() < WIRE_M


def test_part_of_a_performance_is_cut_out_and_can_be_exported_again(project, tmp_path, capsys):
    shape, player = project.shapes["man"], Player(project, "man")
    times = np.arange(25) / 25
    poses = [replace(player.compute_message_pose(time), time_ns=BEGIN + round(time * 1e9)) for time in times]
    people = [(BEGIN + round(time * 1e9), [waving(0, time)]) for time in times]
    write_recording(tmp_path / "live.mcap", [(character_of(shape), poses)], people)
    words = ["--start", "0.2", "--end", "0.6", "--in-place"]
    assert run(["export", str(tmp_path / "live.mcap"), "-o", str(tmp_path / "part.mcap"), *words]) == 0
    assert "contains 0.40 s of motion of man" in capsys.readouterr().out
    (surfaces,) = surfaces_in(Recording(tmp_path / "part.mcap")).values()
    assert len(surfaces) == 11 and surfaces[0][0] == 0 and surfaces[-1][0] == 400_000_000
    expected = skin_vertices(character_of(shape), poses[5])
    assert np.abs(surfaces[0][1] - expected).max() < 2 * WIRE_M, "the second coding adds an error"
    assert run(["export", str(tmp_path / "part.mcap"), "-o", str(tmp_path / "again.mcap")]) == 0
    (again,) = surfaces_in(Recording(tmp_path / "again.mcap")).values()
    for (time, surface), (other_time, other) in zip(surfaces, again, strict=True):
        assert abs(time - other_time) < 1000 and np.abs(surface - other).max() < WIRE_M


def test_tracked_person_keeps_its_joints_and_can_perform_again(tmp_path):
    people = [(BEGIN + round(time * 1e9), [waving(0, time)]) for time in np.arange(40) / 30]
    write_recording(tmp_path / "live.mcap", [], people)
    (exportable,), *_ = find_exportables(tmp_path / "live.mcap")
    performance = exportable.sample(0.0, None, None, "skin", False)
    frames = list(save(tmp_path / "person.mcap", [performance]).frames())
    assert [frame.time_ns for frame in frames] == [round(time * 1e9) for time in performance.times]
    for frame, joints in zip(frames, performance.joints, strict=True):
        np.testing.assert_array_equal(frame.bodies[0].joints, joints)


def test_humanoid_rig_is_a_person_with_its_left_and_right(walk, tmp_path):
    frames = list(save(tmp_path / "walk.mcap", [walk]).frames())
    assert len(frames) == len(walk.times)
    names = walk.skeleton.names
    for frame, joints in zip(frames, walk.joints, strict=True):
        (body,) = frame.bodies
        for joint, name in (
            (Joint.WRIST_LEFT, "Left wrist"),
            (Joint.KNEE_RIGHT, "Right knee"),
            (Joint.SHOULDER_LEFT, "Left shoulder"),
        ):
            np.testing.assert_allclose(body.joints[joint], joints[names.index(name)], atol=1e-9)
            assert body.confidence[joint] == 1.0


def test_people_of_different_rates_are_present_in_every_frame(project, walk, tmp_path):
    other = replace(sample_performance(project, "man", rate=13.0), name="other")
    frames = list(save(tmp_path / "two.mcap", [walk, other]).frames())
    times = [frame.time_ns for frame in frames]
    assert times == sorted(set(times))
    last = round(other.times[-1] * 1e9)
    assert all(len(frame.bodies) == 2 for frame in frames if frame.time_ns <= last)
    assert {body.id for frame in frames for body in frame.bodies} == {1, 2}


def test_all_messages_are_in_order_of_time(walk, tmp_path):
    bean = sample_performance(made_puppets.project(), "bean", rate=13.0)
    save(tmp_path / "both.mcap", [walk, bean])
    with (tmp_path / "both.mcap").open("rb") as file:
        reader = make_reader(file)
        times = [message.log_time for *_, message in reader.iter_messages(log_time_order=False)]
        assert times == sorted(times)
        assert {channel.topic for channel in reader.get_summary().channels.values()} == {
            *("character", "pose", "stage", "/tf", "/bodies")
        }
    assert surfaces_in(Recording(tmp_path / "both.mcap")).keys() == {"man", "bean"}


def test_creature_is_not_a_person(tmp_path):
    bean = sample_performance(made_puppets.project(), "bean", rate=10.0)
    assert "/bodies" not in save(tmp_path / "bean.mcap", [bean]).info.topics


def test_frames_of_foxglove_lead_from_plus_z_up_to_every_joint(walk, tmp_path):
    save(tmp_path / "walk.mcap", [walk])
    up, *frames = frames_in(tmp_path / "walk.mcap")
    assert up[1:3] == ("enliven", "world")
    np.testing.assert_allclose(rotate(up[4], np.array([0.0, 1.0, 0.0])), [0, 0, 1], atol=1e-4)
    count = len(walk.skeleton)
    for number, expected in enumerate(walk.joints):
        world = {"world": (np.zeros(3), np.array([1.0, 0, 0, 0]))}
        for _, parent, child, place, turn in frames[number * count : (number + 1) * count]:
            above, above_turn = world[parent]
            world[child] = above + rotate(above_turn, np.array(place)), multiply(above_turn, turn)
        places = [world[f"man/{name}"][0] for name in walk.skeleton.names]
        np.testing.assert_allclose(places, expected, atol=1e-3)


def test_equal_performances_give_equal_files_and_scale_is_applied(walk, tmp_path):
    for name in ("a", "b"):
        save(tmp_path / f"{name}.mcap", [walk])
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
    double = save(tmp_path / "c.mcap", [walk], scale=2.0)
    ((_, first), *_), *_ = surfaces_in(double).values()
    assert np.abs(first - 2 * next(walk.surfaces())).max() < 2 * WIRE_M


def test_characters_of_one_name_stay_apart(walk, tmp_path):
    names = surfaces_in(save(tmp_path / "two.mcap", [walk, walk])).keys()
    assert names == {"man 1", "man 2"}


def test_stopped_export_leaves_the_old_file(project, tmp_path):
    path = tmp_path / "walk.mcap"
    path.write_bytes(b"old")

    def stop(share):
        if share > 0.5:
            raise KeyboardInterrupt

    performance = performance_of_clip(project.takes["walk"])
    with pytest.raises(KeyboardInterrupt):
        exporter_of(path).save(path, [performance], "walk", progress=stop)
    assert path.read_bytes() == b"old" and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-o", "out.mcap", "--unit", "cm"], ".mcap does not support the option 'unit'. Remove the option."),
        (
            ["-o", "out.mcap", "--up", "z"],
            ".mcap does not support the option 'up'. Remove the option. The format always",
        ),
        (
            ["-o", "live.mcap"],
            "live.mcap: the output file is also the source file. Choose another output file.",
        ),
    ],
)
def test_impossible_recording_is_refused_with_a_sentence(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    write_recording(tmp_path / "live.mcap", [], [(0, [waving(0, 0)])])
    before = (tmp_path / "live.mcap").read_bytes()
    assert run(["export", "live.mcap", *words]) == 3
    assert said in capsys.readouterr().err
    assert (tmp_path / "live.mcap").read_bytes() == before and len(list(tmp_path.iterdir())) == 1
