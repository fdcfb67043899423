"""Tests that a possessed mesh of a take becomes a shape that plays the recording at even time steps."""

import made_puppets
import msgspec
import numpy as np
import pytest

from enliven.document.character import Character, Pose, SkinWeights
from enliven.document.puppet import PuppetLayer, character_from_puppet
from enliven.errors import InputError
from enliven.examples.baking.frames import SurfaceFrames, evaluate_states
from enliven.examples.puppet_motion import evaluate_state, pose_of_state
from enliven.modeling.edits import paste_character
from enliven.modeling.mesh.cut_surfaces import PlaneCut
from enliven.modeling.possessed.pose import graph_pose, graph_vertices
from enliven.modeling.possessed.surgery import cut_graph
from enliven.motion_clips.recorded_characters import read_possessed
from enliven.recording import Recorder
from enliven.rotation import from_rotation_vector, rotate, to_matrix
from enliven.wire.convert import pose_to_message
from enliven.wire.convert_characters import character_to_message
from enliven.wire.posecode import PoseCodec

STEP = 1 / 30


def box(name, kind="graph"):
    corners = np.array([[x, y, z] for x in (0, 1.0) for y in (0, 1.0) for z in (0, 1.0)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])], np.int32)
    skin = SkinWeights(
        np.array([[k, 0, 0, 0] for k in range(8)], np.uint16), np.eye(4, dtype=np.float32)[[0] * 8]
    )
    edges = np.array([[0, 1], [0, 2], [0, 4], [1, 3], [2, 6], [4, 5], [5, 7]], np.int32)
    points = corners.astype(np.float32)
    return Character(name, points, faces, skin, points, edges, kind)


def pose(character, second):
    turn = to_matrix(from_rotation_vector(np.array([0, 0, 0.5 * second])))
    moved = character.pivots @ turn.T + [second, 0, 0]
    linear = np.tile(turn, (8, 1, 1)).astype(np.float32)
    return Pose(character.id, round(second * 1e9), linear, moved.astype(np.float32))


def write(path, *casts, pose=pose):
    """Writes a take with (character, revision, seconds of the poses)."""
    with Recorder(path) as recorder:

        def put(topic, message, time_ns):
            data = msgspec.msgpack.encode(message)
            recorder.write(topic, f"enliven.{topic}", "{}", "jsonschema", "msgpack", data, time_ns)

        for character, revision, seconds in casts:
            codec = PoseCodec(character)
            put("character", character_to_message(character, revision), 0)
            for second in seconds:
                posed = pose(character, second)
                put("pose", pose_to_message(posed, codec, revision=revision), posed.time_ns)
            put("pose", ["not", "a", "pose"], 1)


def test_take_becomes_shapes_that_play_it(tmp_path):
    jittered = 5 + np.sort(np.arange(0, 2, STEP) + np.random.default_rng(0).uniform(0, 0.005, 60))
    chair, lamp = box("chair"), box("lamp")
    write(tmp_path / "take.mcap", (chair, 1, jittered), (lamp, 4, 6 + np.arange(0, 1, STEP)))
    project = read_possessed(tmp_path / "take.mcap")
    assert sorted(project.graphs) == ["chair", "lamp"]
    assert project.streams["chair"].step == pytest.approx(STEP, abs=1e-3)
    for name, since in (("chair", 0.0), ("chair", 0.731), ("chair", 1.9), ("lamp", 1.4)):
        shape = project.graph(name)
        linear, places = graph_pose(project, shape, since)
        expected = pose(chair, jittered[0] + since)
        np.testing.assert_allclose(places, expected.positions, atol=3e-3)
        np.testing.assert_allclose(linear, expected.linear, atol=5e-3)
    middle = graph_pose(project, project.graph("chair"), 0.5)[1].mean(0)
    edited, ids = cut_graph(project, "chair", PlaneCut(middle, [0.3, 1.0, 0]), 0.5)
    assert len(ids) == 2
    pasted, copy = paste_character(edited, project, "lamp", delay=0.5)
    assert list(pasted.streams) == list(project.streams)
    later = graph_pose(pasted, pasted.graph(copy), 1.9)
    for value, then in zip(later, graph_pose(project, project.graph("lamp"), 1.4), strict=True):
        np.testing.assert_allclose(value, then, atol=1e-9)
    other, _ = paste_character(
        read_possessed(tmp_path / "take.mcap").drop_character("chair"), project, "chair"
    )
    assert list(other.streams) == list(project.streams)


def test_a_mesh_taken_up_again_with_other_nodes_is_another_shape(tmp_path):
    chair = box("chair")
    seconds = np.arange(0, 1, STEP)
    write(tmp_path / "take.mcap", (chair, 1, seconds), (chair, 2, 2 + seconds))
    project = read_possessed(tmp_path / "take.mcap")
    assert list(project.graphs) == ["chair", "chair 2"]
    assert project.graph("chair 2").parts[0].offset == pytest.approx(2.0)


def test_a_take_without_possessed_meshes_is_refused(tmp_path):
    write(tmp_path / "bones.mcap", (box("rig", "bones"), 1, np.arange(0, 1, STEP)))
    write(tmp_path / "still.mcap", (box("chair"), 1, [0.5]))
    for name in ("bones", "still"):
        with pytest.raises(InputError, match="no motion of a possessed mesh"):
            read_possessed(tmp_path / f"{name}.mcap")
    with pytest.raises(InputError):
        read_possessed(tmp_path / "nothing.mcap")


def test_a_puppet_that_was_performed_moves_again_within_the_stated_error(tmp_path):
    project = made_puppets.project(layers=(PuppetLayer("dance"),), place=np.array([0.5, 0.0, 1.0]))
    puppet = project.puppet("bean")
    seconds = np.arange(40) * STEP

    def put(character, second):
        return pose_of_state(puppet, evaluate_state(project, puppet, second), round(second * 1e9))

    write(tmp_path / "take.mcap", (character_from_puppet(puppet), 1, seconds), pose=put)
    notes = []
    read = read_possessed(tmp_path / "take.mcap", notes)
    (note,) = notes
    assert "'bean'" in note and "% of the mesh's size" in note
    shape = read.graph("bean")
    assert len(shape.positions) > 4 and read.streams["bean"].duration == pytest.approx(39 * STEP, abs=1e-3)
    places, turns, roots = evaluate_states(project, puppet, seconds)
    size = np.linalg.norm(np.ptp(puppet.mesh.vertices, axis=0))
    for frame, vertices in enumerate(SurfaceFrames(puppet, places)()):
        if frame % 13 == 0:
            expected = rotate(turns[frame], vertices) + roots[frame]
            shown = graph_vertices(shape, *graph_pose(read, shape, seconds[frame]))
            assert np.linalg.norm(shown - expected, axis=1).max() < 0.012 * size
