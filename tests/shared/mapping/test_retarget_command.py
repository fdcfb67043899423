"""Tests of ``enliven retarget``: input files, a valid GLB, an editable mapping, and errors with advice."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_bodies import bvh_text, horse, man, random_motion, shape_with_joint_bands, shape_with_markers

from enliven.cli import run
from enliven.document.project import Project
from enliven.exporters import sample_performance
from enliven.exporters.gltf.write import write_gltf
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import play_clip
from enliven.mapping.automatic_mapping import create_automatic_plan
from enliven.mapping.automatic_mapping import retarget as retarget_shape
from enliven.motion_clips.take_files import read_take
from enliven.recording import Recorder

sys.path[:0] = [str(Path(__file__).parents[1] / "formats"), str(Path(__file__).parents[1] / "motion_clips")]
from strict_gltf import checked_glb  # noqa: E402
from test_tracked_people import frame  # noqa: E402


@pytest.fixture
def files(tmp_path):
    """Writes a walk of a generated man as BVH, and a generated horse as GLB."""
    frames = 8.0 * np.sin(np.arange(12)[:, None, None] + np.arange(len(man()))[None, :, None])
    (tmp_path / "walk.bvh").write_text(bvh_text(man(), np.tile(frames, (1, 1, 3))))
    clip = random_motion(np.random.default_rng(0), horse(), name="graze")
    project, _ = play_clip(Project(), shape_with_markers("horse", horse()), clip)
    write_gltf(tmp_path / "horse.glb", [sample_performance(project, "horse")], "graze")
    write_gltf(
        tmp_path / "man.glb",
        [sample_performance(Project().with_characters(shape_with_markers("man", man())), "man")],
    )
    return tmp_path


def retarget(folder, *options, take="walk.bvh", model="horse.glb"):
    return run(["retarget", str(folder / take), str(folder / model), *map(str, options)])


def test_a_horse_walks_as_the_man_does(files, capsys):
    assert retarget(files, "-o", files / "out.glb") == 0
    assert "contains 0.55 s of motion" in capsys.readouterr().out
    document = checked_glb((files / "out.glb").read_bytes())
    assert document["animations"][0]["name"] == "walk on horse"
    rig = read_gltf(files / "out.glb")
    assert rig.shape.skeleton.names == read_gltf(files / "horse.glb").shape.skeleton.names
    assert np.ptp(rig.clips[0].turns, axis=0).max() > 0.05
    # The whole model stays in place, except for rising and sinking with its legs.
    assert np.ptp(rig.clips[0].root, axis=0)[[0, 2]].max() < 1e-6


def test_written_mapping_gives_the_same_result(files):
    first, second, other = files / "one.glb", files / "two.glb", files / "other.glb"
    assert retarget(files, "-o", first, "--write-map", files / "map.toml") == 0
    assert retarget(files, "-o", second, "--map", files / "map.toml") == 0
    assert first.read_bytes() == second.read_bytes()
    text = (files / "map.toml").read_text()
    assert 'source = "Left hip .. Left knee"' in text
    text = text.replace("weight = 0.5\n", "")
    (files / "map.toml").write_text(text.replace('mode = "move"', 'mode = "move"\nweight = 0.0'))
    assert retarget(files, "-o", other, "--map", files / "map.toml", "--no-turn") == 0
    assert "animations" not in checked_glb(other.read_bytes())


def test_options_cut_scale_and_travel(files):
    out = files / "out.glb"
    assert (
        retarget(files, "-o", out, "--start", 0.1, "--end", 0.3, "--height", 2, "--travel", "--rate", 10) == 0
    )
    rig = read_gltf(out)
    assert rig.clips[0].duration == pytest.approx(0.2)
    assert np.ptp(rig.shape.mesh.vertices[:, 1]) == pytest.approx(2)
    assert np.linalg.norm(rig.clips[0].root[-1] - rig.clips[0].root[0]) > 0.1


def test_a_person_of_a_recording_is_a_take(files, capsys):
    with Recorder(files / "wave.mcap") as recorder:
        for i in range(30):
            recorder.write_frame(frame(i / 30, 1))
    assert retarget(files, "-o", files / "a.glb", "--end", 0.4, take="wave.mcap") == 0
    checked_glb((files / "a.glb").read_bytes())
    assert "contains 0.40 s of motion" in capsys.readouterr().out
    (clip,) = read_gltf(files / "a.glb").clips
    left, right = (clip.skeleton.index(f"{side} elbow") for side in ("Left", "Right"))
    assert np.ptp(clip.turns[:, left], axis=0).max() > 0.1 > np.ptp(clip.turns[:, right], axis=0).max()


def test_feet_are_held_on_request(files):
    assert retarget(files, "-o", files / "a.glb", "--travel", "--pin", model="man.glb") == 0
    checked_glb((files / "a.glb").read_bytes())
    shape = read_gltf(files / "man.glb").shape
    clip, _ = read_take(files / "walk.bvh")
    plan = replace(create_automatic_plan(clip, shape), travel=True, pin=True)
    # A person's feet are planted by the step detection. Swung legs of another mapping are pinned by their
    # contacts.
    for steps, how in ((True, ()), (False, ("Left ankle", "Right ankle"))):
        result = retarget_shape(shape, clip, replace(plan, steps=steps))
        moved = result.project.shape(result.shape_id)
        assert tuple(pin.joint for pin in moved.pins) == how
        assert any("steps" in layer.take for layer in moved.layers) == steps


@pytest.mark.slow
def test_stretched_surface_is_reported_with_joints_and_a_better_mapping(files, capsys):
    banded = Project().with_characters(shape_with_joint_bands("banded", horse()))
    write_gltf(files / "banded.glb", [sample_performance(banded, "banded")])
    wide = 60.0 * np.sin(np.arange(12)[:, None, None] + np.arange(len(man()))[None, :, None])
    (files / "wide.bvh").write_text(bvh_text(man(), np.tile(wide, (1, 1, 3))))
    map_ = files / "map.toml"
    soft = ["-o", files / "a.glb", "--soften", "--write-map", map_]
    assert retarget(files, *soft, take="wide.bvh", model="banded.glb") == 0
    assert "limbs with reduced movement: " in capsys.readouterr().out
    options = ["-o", files / "a.glb", "--write-map", files / "used.toml"]
    assert retarget(files, *options, take="wide.bvh", model="banded.glb") == 0
    output = capsys.readouterr()
    assert "edges stretch " in output.out and "below the floor" in output.out
    assert "moved less" not in output.out
    named = re.search(r"stretches at (.*) \(--soften reduces the motion\)", output.err).group(1).split(", ")
    assert set(named) <= set(horse().names)
    offered = float(
        re.search(
            "the best alternative mapping, .*: edges stretch by a factor of ([0-9.]+)", output.err
        ).group(1)
    )
    used = float(re.search("edges stretch by a factor of ([0-9.]+)", output.out).group(1))
    assert offered < used
    better = ["-o", files / "b.glb", "--map", files / "used.next.toml"]
    assert retarget(files, *better, take="wide.bvh", model="banded.glb") == 0
    assert float(re.search("edges stretch by a factor of ([0-9.]+)", capsys.readouterr().out).group(1)) < used


@pytest.mark.parametrize("rest", ["zero", "first", "mean", "0.2"])
def test_another_rest_pose_is_another_movement(files, rest):
    assert retarget(files, "-o", files / "a.glb", "--rest", rest, "--mode", "move") == 0
    checked_glb((files / "a.glb").read_bytes())
    (clip,) = read_gltf(files / "a.glb").clips
    first, bone = clip.turns[0], clip.skeleton.index("Left stifle")
    # Relative to its own first frame, the movement begins at zero: within half a degree.
    assert (abs(first[bone, 0]) > 1 - 1e-5) == (rest == "first")


def test_an_animation_of_a_model_is_a_take(files, capsys):
    assert retarget(files, "-o", files / "a.glb", "--mode", "pose", take="horse.glb") == 0
    assert "in the performer's pose" in capsys.readouterr().out
    assert retarget(files, "-o", files / "a.glb", "--animation", "graze", take="horse.glb") == 0
    assert retarget(files, "-o", files / "a.glb", "--animation", "fly", take="horse.glb") == 3
    assert "Known animations: graze" in capsys.readouterr().err


def test_a_models_own_take_is_copied_joint_by_joint(files, capsys):
    assert retarget(files, "-o", files / "a.glb", take="horse.glb") == 0
    assert "copied joint by joint" in capsys.readouterr().out
    (own,), (copied,) = (read_gltf(files / name).clips for name in ("horse.glb", "a.glb"))
    assert copied.step == own.step
    np.testing.assert_allclose(np.abs(np.sum(own.turns * copied.turns, axis=-1)), 1.0, atol=1e-6)
    np.testing.assert_allclose(copied.root, own.root, atol=1e-6)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--start", "9"], "the motion lasts 0.55 s"),
        (["--rest", "soon"], "--rest: rest is 'soon'"),
        (["--map", "none.toml"], "none.toml: the file does not exist"),
        (["--height", "-1"], "cannot be scaled to -1.0 m"),
    ],
)
def test_impossible_requests_are_reported(files, capsys, options, words):
    assert retarget(files, "-o", files / "a.glb", *options) == 3
    assert words in capsys.readouterr().err
    assert not (files / "a.glb").exists()


def test_a_mapping_with_a_joint_that_is_not_there_lists_those_that_are(files, capsys):
    (files / "map.toml").write_text('[[chain]]\nsource = "Left hipp .. Left knee"\ntarget = "Left hip"\n')
    assert retarget(files, "-o", files / "a.glb", "--map", files / "map.toml") == 3
    output = capsys.readouterr().err
    assert "the take has no joint 'Left hipp'" in output
    assert "Left ankle" in output


def test_files_of_the_wrong_kind_are_refused(files, capsys):
    assert retarget(files, "-o", files / "a.glb", take="horse.png") == 3
    assert "Known formats: .bvh" in capsys.readouterr().err
    assert retarget(files, "-o", files / "a.glb", model="walk.bvh") == 3
    assert "the file is not a glTF file" in capsys.readouterr().err
    assert retarget(files, "-o", files / "a.fbx") == 3
    assert ".fbx cannot be written. Known suffixes: .bvh, .csv, .glb" in capsys.readouterr().err


@pytest.mark.slow
def test_exceeded_joint_limits_are_reported_and_can_be_disabled(files, capsys):
    """A slightly grazing horse is not bent as far as a tumbling man. The option --no-limits bends it that
    far.
    """
    frames = 80.0 * np.sin(np.arange(12)[:, None, None] + np.arange(len(man()))[None, :, None])
    (files / "tumble.bvh").write_text(bvh_text(man(), np.tile(frames, (1, 1, 3))))
    assert retarget(files, "-o", files / "kept.glb", take="tumble.bvh") == 0
    output = capsys.readouterr().out
    assert re.search(
        r"enliven: \d+ joints stayed within the joint limits \(--no-limits turns them off\): \w+", output
    ), output
    options = ("--no-limits", "--write-map", files / "map.toml")
    assert retarget(files, "-o", files / "freed.glb", *options, take="tumble.bvh") == 0
    assert "joint limits" not in capsys.readouterr().out
    assert "limits = false" in (files / "map.toml").read_text()
    assert (files / "kept.glb").read_bytes() != (files / "freed.glb").read_bytes()
