"""Tests of ``enliven export``: recordings, projects and motion files to GLB and BVH, and errors with
advice.
"""

import json
import struct
from dataclasses import replace

import made_puppets
import numpy as np
import pytest
from made_bodies import man, random_motion, shape_with_markers
from made_recording import write_recording
from slow_gltf import SlowGltf
from strict_gltf import checked_glb
from test_capture_clip import STANDING
from test_tracked_people import waving

from enliven.camera import Intrinsics
from enliven.cli import run
from enliven.deformation.skinning import skin_vertices
from enliven.document import Project, character_of, graph_shape_from_poses
from enliven.exporters.bvh import bvh_text
from enliven.exporters.sampling import performance_of_clip
from enliven.formats.motion.bvh import read_bvh
from enliven.formats.project.file import write_project
from enliven.formats.rig.rig import play_clip
from enliven.frames import DepthFrame
from enliven.motion.layers.evaluate import Player
from enliven.recording import Recorder

BEGIN = 7_000_000_000
"""Time of the recording's first frame on the sensor's clock, nanoseconds."""
WIRE = 4e-3
"""Maximum position error in metres of poses on the wire, added up along a limb."""


def export(folder, *words):
    """Runs the command and returns its exit code. Words with a suffix become files in the folder."""
    return run(["export", *(str(folder / w) if isinstance(w, str) and "." in w else str(w) for w in words)])


@pytest.fixture(scope="module")
def made():
    """Returns a man with a mesh, his motion, and the project in which he performs it."""
    shape = shape_with_markers("man", man())
    clip = random_motion(np.random.default_rng(1), shape.skeleton, name="walk")
    return play_clip(Project(), shape, clip)


@pytest.fixture
def recorded(made, tmp_path):
    """Returns a live performance of the rigged man and of the person who performed it."""
    project, shape = made
    character, player = character_of(shape), Player(project, "man")
    times = np.arange(25) / 25
    poses = [replace(player.compute_message_pose(t), time_ns=BEGIN + round(t * 1e9)) for t in times]
    people = [(BEGIN + round(t * 1e9), [waving(0, t)]) for t in times]
    write_recording(tmp_path / "live.mcap", [(character, poses)], people)
    return character, poses


def test_a_live_performance_on_a_rigged_model_is_a_skeleton_and_a_surface(recorded, tmp_path, capsys):
    character, poses = recorded
    assert export(tmp_path, "live.mcap", "-o", "man.bvh") == 0
    assert "contains 0.96 s of motion of man" in capsys.readouterr().out
    read = read_bvh(tmp_path / "man.bvh")
    assert read.frames == len(poses)
    for frame, pose in enumerate(poses):
        apart = np.linalg.norm(pose.positions[:, None] - read.positions[frame][None], axis=2)
        assert apart.min(1).max() < WIRE, "there is a joint where each bone begins"
    assert export(tmp_path, "live.mcap", "-o", "man.glb") == 0
    nodes = checked_glb((tmp_path / "man.glb").read_bytes())["nodes"]
    assert set(character.names) <= {node.get("name") for node in nodes}, "each joint has its own name"
    slow = SlowGltf(tmp_path / "man.glb")
    for frame in (0, 11, 24):
        seen = slow.vertices_at(0, frame / 25)
        assert np.abs(seen - skin_vertices(character, poses[frame])).max() < WIRE


def test_a_part_is_cut_out_at_another_rate_and_in_centimetres(recorded, tmp_path):
    words = ("--start", 0.2, "--end", 0.6, "--rate", 50, "--unit", "cm")
    assert export(tmp_path, "live.mcap", "-o", "part.bvh", *words) == 0
    read = read_bvh(tmp_path / "part.bvh")
    assert read.frames == 21 and read.seconds == pytest.approx(0.02)
    _, poses = recorded
    assert np.abs(read.positions[0, 0] / 100 - poses[5].positions[0]).max() < WIRE


def test_the_person_of_a_performance_is_a_skeleton_too(recorded, tmp_path):
    assert export(tmp_path, "live.mcap", "-o", "person.bvh", "-c", "live") == 0
    read = read_bvh(tmp_path / "person.bvh")
    hand = np.array([body.joints[6] for body in (waving(0, k / 30) for k in range(read.frames))])
    assert np.abs(read.positions[:, read.names.index("wrist_left")] - hand).max() < 0.01
    assert export(tmp_path, "live.mcap", "-o", "person.glb", "-c", "live") == 0
    low = SlowGltf(tmp_path / "person.glb").vertices_at(0, 0.0)[:, 1].min()
    assert low == pytest.approx(STANDING[:, 1].min(), abs=0.05), "bones are drawn as sticks"


def test_a_recording_of_people_alone_is_exported_without_naming_one(recorded, tmp_path):
    people = [(BEGIN + round(t * 1e9), [waving(0, t)]) for t in np.arange(40) / 30]
    write_recording(tmp_path / "alone.mcap", [], people)
    assert export(tmp_path, "alone.mcap", "-o", "alone.bvh") == 0
    assert read_bvh(tmp_path / "alone.bvh").duration == pytest.approx(1.3, abs=0.04)


@pytest.fixture
def show(made, recorded, tmp_path):
    """Returns a project with a rigged shape, a possessed mesh and a puppet."""
    project, _ = made
    character, poses = recorded
    graph, stream = graph_shape_from_poses(replace(character, id="chair", kind="graph"), poses, "sit")
    bean = made_puppets.project()
    project = project.with_takes(*bean.takes.values())
    whole = project.with_streams(stream).with_characters(graph, *bean.puppets.values())
    write_project(tmp_path / "show.enliven", whole)
    return tmp_path


def test_every_rig_of_a_project_is_exported(show, capsys):
    assert export(show, "show.enliven", "-o", "show.glb", "--end", 0.4) == 0
    document = checked_glb((show / "show.glb").read_bytes())
    assert {skin["name"] for skin in document["skins"]} == {"man", "chair", "bean"}
    assert "bean is off by" in capsys.readouterr().out
    words = ("--end", 0.2, "-c", "bean", "--morphs")
    assert export(show, "show.enliven", "-o", "bean.glb", *words) == 0
    (mesh,) = checked_glb((show / "bean.glb").read_bytes())["meshes"]
    assert mesh["primitives"][0]["targets"]
    assert export(show, "show.enliven", "-o", "show.bvh") == 0, "one of the three has a skeleton"
    assert "Left_elbow" in read_bvh(show / "show.bvh").names


def test_motion_files_are_turned_into_one_another(made, tmp_path):
    project, _ = made
    clip = project.takes["walk"]
    (tmp_path / "dance.bvh").write_text(bvh_text(performance_of_clip(clip)))
    assert export(tmp_path, "dance.bvh", "-o", "dance.glb") == 0
    assert export(tmp_path, "dance.glb", "-o", "again.bvh", "--rate", 1 / clip.step) == 0
    first, second = read_bvh(tmp_path / "dance.bvh"), read_bvh(tmp_path / "again.bvh")
    assert first.frames == second.frames
    for name in ("Left_wrist", "head", "Right_ankle"):
        off = first.positions[:, first.names.index(name)] - second.positions[:, second.names.index(name)]
        assert np.abs(off).max() < 1e-4


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("no.mcap", "-o", "out.fbx"), 3, ".fbx cannot be written. Known suffixes: .bvh, .csv, .glb"),
        (("no.mcap", "-o", "moveis/out.glb"), 4, "moveis' does not exist"),
        (("no.mcap", "-o", "out.glb", "--unit", "cm"), 3, ".glb does not support the option 'unit'"),
        (
            ("no.mcap", "-o", "out.bvh", "--unit", "inch"),
            3,
            "the unit 'inch' is unknown. Known units: m, cm.",
        ),
        (("no.mcap", "-o", "out.bvh", "--morphs"), 3, ".bvh does not support the option 'morphs'"),
        (("no.mcap", "-o", "out.glb"), 3, "the file does not exist"),
        (
            ("empty.mcap", "-o", "out.glb"),
            3,
            "the file contains no motion. Record a performance that lasts longer",
        ),
        (
            ("depth.mcap", "-o", "out.glb"),
            3,
            "motion. Track the people in the depth images first: enliven track depth",
        ),
        (
            ("show.enliven", "-o", "out.glb", "-c", "sofa"),
            3,
            "no character 'sofa'. Known characters: man, chair, bean",
        ),
        (
            ("show.enliven", "-o", "out.bvh", "-c", "chair"),
            3,
            "chair has no skeleton, but the output format needs one. Write a .glb file instead",
        ),
        (
            ("show.enliven", "-o", "out.bvh", "-c", "man", "-c", "dance"),
            3,
            "Choose one with --character: man",
        ),
        (("show.enliven", "-o", "out.glb", "--start", 9, "--end", 8), 3, "frames per second is not valid"),
        (("live.mcap", "-o", "out.bvh", "-c", "live", "--start", 9), 3, "there is no motion from 9 s"),
    ],
)
def test_impossible_export_is_reported_and_leaves_no_file(show, capsys, words, code, said):
    write_recording(show / "empty.mcap", [])
    with Recorder(show / "depth.mcap") as recorder:
        recorder.write_frame(
            DepthFrame(np.zeros((4, 6), np.uint16), Intrinsics(6, 4, 5, 5, 3, 2), 0, "kinect")
        )
    before = set(show.rglob("*"))
    assert export(show, *words) == code
    error = capsys.readouterr().err
    assert said in error and "Traceback" not in error
    assert set(show.rglob("*")) == before


def test_a_character_of_bones_that_hang_on_nothing_is_refused(recorded, tmp_path, capsys):
    character, poses = recorded
    pivots = character.pivots.copy()
    pivots[4] += 1.0
    write_recording(
        tmp_path / "odd.mcap", [(replace(character, pivots=pivots, edges=character.edges[:0]), poses)]
    )
    assert export(tmp_path, "odd.mcap", "-o", "odd.bvh") == 3
    assert "has no parent" in capsys.readouterr().err


def test_stick_glb_contains_its_skeleton(made, tmp_path):
    project, _ = made
    (tmp_path / "dance.bvh").write_text(bvh_text(performance_of_clip(project.takes["walk"])))
    assert export(tmp_path, "dance.bvh", "-o", "dance.glb") == 0
    data = (tmp_path / "dance.glb").read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    names = [node.get("name") for node in json.loads(data[20 : 20 + length])["nodes"]]
    assert "Left_elbow" in names


@pytest.mark.parametrize("name", ["show.csv", "show.obj-sequence", "show.usdc"])
def test_formats_without_bones_hold_every_rig_and_bake_nothing(show, capsys, name):
    if name.endswith("usdc"):
        pytest.importorskip("pxr", reason="usd-core is not installed (the extra 'usd')")
    assert export(show, "show.enliven", "-o", name, "--end", 0.2, "--rate", 10, "--scale", 2) == 0
    output = capsys.readouterr().out
    assert "contains 0.20 s of motion of man, chair, bean" in output
    assert ("bean is off by" in output) == name.endswith("csv"), "only a table needs transforms"


def test_the_person_of_a_performance_is_a_vrm_animation(recorded, tmp_path):
    assert export(tmp_path, "live.mcap", "-o", "person.vrma", "-c", "live") == 0
    document = checked_glb((tmp_path / "person.vrma").read_bytes())
    bones = document["extensions"]["VRMC_vrm_animation"]["humanoid"]["humanBones"]
    assert {"hips", "spine", "head", "leftLowerArm", "rightFoot"} <= set(bones)


def test_interrupted_command_ends_with_its_code_and_leaves_nothing(show, monkeypatch, capsys):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("enliven.exporters.obj_sequence._vertex_lines", interrupt)
    before = set(show.rglob("*"))
    assert export(show, "show.enliven", "-o", "show.obj-sequence", "--end", 0.2) == 130
    assert set(show.rglob("*")) == before
