"""Tests of ``enliven examples``: input files, an editable session, a valid GLB, and errors with advice."""

import sys
from pathlib import Path

import numpy as np
import pytest
from puppet_worlds import full_session, stool, walker

from enliven.cli import run
from enliven.document.project import Project, are_identical
from enliven.example_sessions.session import read_session
from enliven.examples.coverage import describe_unposed, measure_coverage
from enliven.examples.performer import extract_performer_clip
from enliven.examples.puppet_motion import evaluate_state, pose_of_state
from enliven.formats.project.file import read_project, write_project
from enliven.meshes.files import save_mesh
from enliven.modeling.edits import change_layers
from enliven.recording import Recording
from enliven.wire.characters import CharacterMessage
from enliven.wire.convert import message_to_pose
from enliven.wire.convert_characters import message_to_character
from enliven.wire.posecode import PoseCodec
from enliven.wire.streams import PoseMessage

sys.path.append(str(Path(__file__).parents[1] / "formats"))
import msgspec
from strict_gltf import checked_glb


@pytest.fixture
def folder(tmp_path):
    save_mesh(stool(), tmp_path / "stool.ply")
    write_project(tmp_path / "walk.enliven", Project().with_takes(walker()))
    return tmp_path


def examples(folder, *words):
    """Runs the command and returns its exit code. Words with a dot become files in the folder."""
    plain = [str(folder / w) if isinstance(w, str) and "." in w else str(w) for w in words]
    return run(["examples", *plain])


@pytest.mark.slow
def test_from_a_mesh_and_a_motion_to_a_film_of_it(folder, capsys):
    (folder / "s").mkdir()
    assert (
        examples(folder, "new", "stool.ply", "walk.enliven", "-o", "s/made.toml", "--points", 8, "--poses", 3)
        == 0
    )
    assert "control points and 3 key poses" in capsys.readouterr().out
    read = read_session(folder / "s" / "made.toml")
    puppet = read.project.puppets["stool"]
    assert len(puppet.poses) == 3 and len(puppet.points) >= 8 and len(puppet.layers) == 1
    assert len({point.joint for point in puppet.points}) > 3
    for pose in puppet.poses:
        np.testing.assert_array_equal(pose.places, puppet.rest)
    # Nothing is posed yet, which is reported.
    assert examples(folder, "check", "s/made.toml") == 3
    assert "All key poses are equal: move the control points of the key poses." in capsys.readouterr().out
    # No film of the unposed, sliding mesh is made. The project can be posed in the studio.
    assert examples(folder, "fit", "s/made.toml", "-o", "out.glb", "--end", 1) == 3
    assert "All key poses are equal" in capsys.readouterr().err and not (folder / "out.glb").exists()
    assert examples(folder, "fit", "s/made.toml", "-o", "unposed.enliven") == 0
    capsys.readouterr()
    text = (folder / "s" / "made.toml").read_text()
    name = puppet.points[0].name
    posed = text.replace(f'"{name}" = [0.0, 0.0, 0.0]', f'"{name}" = [0.1, 0.2, 0.0]', 1)
    assert posed != text
    (folder / "s" / "made.toml").write_text(posed)
    assert examples(folder, "check", "s/made.toml") == 0
    output = capsys.readouterr().out
    assert "the pose that differs most from all examples is" in output and f"{name} - " in output
    assert examples(folder, "fit", "s/made.toml", "-o", "out.glb", "--end", 1, "--rate", 10) == 0
    assert "contains 1.00 s of motion from 3 key poses" in capsys.readouterr().out
    document = checked_glb((folder / "out.glb").read_bytes())
    assert document["animations"]


@pytest.mark.slow
def test_the_project_that_is_made_is_the_session(folder):
    full_session(folder / "full.toml")
    assert examples(folder, "fit", "full.toml", "-o", "full2.enliven") == 0
    assert are_identical(read_project(folder / "full2.enliven"), read_session(folder / "full.toml").project)
    # A project is accepted like a session.
    assert examples(folder, "fit", "full2.enliven", "-o", "a.glb", "--puppet", "stool", "--end", 0.5) == 0
    assert examples(folder, "fit", "full.toml", "-o", "b.glb", "--end", 0.5) == 0
    assert (folder / "a.glb").read_bytes() == (folder / "b.glb").read_bytes()


def test_a_take_has_the_states(folder):
    full_session(folder / "full.toml")
    assert (
        examples(folder, "fit", "full.toml", "-o", "out.mcap", "--start", 0.5, "--end", 1.5, "--rate", 20)
        == 0
    )
    project = read_session(folder / "full.toml").project
    puppet = project.puppets["stool"]
    recording = Recording(folder / "out.mcap")
    [(_, data)] = recording.messages("character")
    character = message_to_character(msgspec.msgpack.decode(data, type=CharacterMessage))
    assert character.kind == "points" or character.pivots.shape == (6, 3)
    codec = PoseCodec(character)
    poses = [
        message_to_pose(msgspec.msgpack.decode(data, type=PoseMessage), codec)
        for _, data in recording.messages("pose")
    ]
    assert [pose.time_ns for pose in poses] == [round(n * 5e7) for n in range(21)]
    for pose in poses[::5]:
        there = pose_of_state(puppet, evaluate_state(project, puppet, 0.5 + pose.time_ns / 1e9))
        np.testing.assert_allclose(pose.positions, there.positions, atol=2e-3)


@pytest.mark.slow
def test_a_sheet_is_drawn_where_the_viewer_is(folder):
    pytest.importorskip("moderngl")
    from PIL import Image

    full_session(folder / "full.toml")
    assert examples(folder, "fit", "full.toml", "-o", "out.mcap", "--sheet", "out.png", "--end", 1) == 0
    picture = np.asarray(Image.open(folder / "out.png"))
    assert picture.shape[1] > 6 * 400
    # Both rows have content in each image, and the images differ.
    rows = picture[-880:-440], picture[-440:]
    for row in rows:
        tiles = np.array_split(row[:, : row.shape[1] // 6 * 6], 6, axis=1)
        assert all(tile.std() > 5 for tile in tiles)
        assert not np.array_equal(tiles[0], tiles[3])


def test_coverage_is_the_farthest_pose_found_by_looking_at_each(folder):
    """The slow reference computes all distances to all examples."""
    project = full_session(folder / "full.toml")
    puppet, clip = project.puppets["stool"], project.takes["walk"]
    plain = project.with_characters(puppet.with_changes(symmetry=None))
    coverage = measure_coverage(plain, plain.puppets["stool"], 0)
    poses = extract_performer_clip(clip, [point.joint for point in puppet.points]).poses
    existing = [poses[round(pose.time / clip.step)] for pose in puppet.poses]
    gaps = [min(np.sqrt(((pose - near) ** 2).sum(1).mean()) for near in existing) for pose in poses]
    assert coverage.frame == int(np.argmax(gaps)) and coverage.gap == pytest.approx(max(gaps))
    assert coverage.time == pytest.approx(coverage.frame * clip.step)
    assert describe_unposed(puppet) == ()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("fit", "nowhere.toml", "-o", "out.glb"), "the file does not exist"),
        (
            ("fit", "full.toml", "-o", "out.abc"),
            ".abc cannot be written. Known suffixes: .bvh, .csv, .enliven, .glb",
        ),
        (
            ("fit", "full.toml", "-o", "out.glb", "--start", 5, "--end", 2),
            "the time range from 5 s to 2 s is empty",
        ),
        (
            ("fit", "full.toml", "-o", "out.glb", "--puppet", "chair"),
            "no puppet 'chair'. The project contains: stool.",
        ),
        (
            ("fit", "walk.enliven", "-o", "out.glb"),
            "the project has no puppet. Make a puppet from a mesh first.",
        ),
        (("fit", "bare.toml", "-o", "out.glb"), "Put control points on the mesh."),
        (
            ("fit", "still.toml", "-o", "out.glb"),
            "the puppet plays no motion. Add a [[layer]] with the motion that the puppet plays.",
        ),
        (
            ("new", "stool.ply", "walk.enliven", "-o", "new.toml", "--up", "w"),
            "'w' is not an axis. Write x, y or z.",
        ),
        (("new", "stool.ply", "stool.ply", "-o", "new.toml"), "ply is not a motion file"),
        (
            ("new", "stool.ply", "walk.enliven", "-o", "new.enliven"),
            "a session file cannot have the suffix .enliven",
        ),
        (
            ("new", "stool.ply", "walk.enliven", "-o", "new.toml", "--start", 9),
            "it cannot be cut from 9 s to 3 s",
        ),
    ],
)
def test_impossible_request_is_reported(folder, capsys, words, said):
    full_session(folder / "full.toml", loose=True)
    (folder / "bare.toml").write_text('[mesh]\nfile = "stool.ply"\n')
    still = (folder / "full.toml").read_text().replace("[[layer]]\n", "[[layer]]\nmuted = true\n", 1)
    (folder / "still.toml").write_text(still)
    assert examples(folder, *words) == 3
    error = capsys.readouterr().err
    assert said in error and "Traceback" not in error
    assert not (folder / "out.glb").exists() and not (folder / "new.toml").exists()


def test_missing_input_is_reported_before_solving(folder, capsys):
    (folder / "bare.toml").write_text('[mesh]\nfile = "stool.ply"\n[[point]]\nvertex = 3\n')
    assert examples(folder, "check", "bare.toml") == 3
    output = capsys.readouterr().out
    for sentence in (
        "Pair 'point 1' with a joint.",
        "Pose two examples.",
        "Add a [[layer]] with the motion that the puppet plays.",
    ):
        assert sentence in output


def test_help_has_worked_examples(capsys):
    help_texts = {
        ("--help",): "fit cactus.toml",
        ("fit", "--help"): "--sheet cactus.png",
        ("new", "--help"): "--up z",
        ("check", "--help"): "check SHOW.enliven --puppet cactus",
    }
    for words, example in help_texts.items():
        assert run(["examples", *words]) == 0
        assert example in capsys.readouterr().out


def test_muted_layer_does_not_set_the_length(folder, capsys):
    project = full_session(folder / "full.toml")
    muted = change_layers(project, "stool", [1], muted=True)
    write_project(folder / "muted.enliven", muted)
    assert examples(folder, "fit", "muted.enliven", "-o", "out.mcap") == 0
    assert "contains 3.00 s of motion" in capsys.readouterr().out
