"""Tests that cubic keys of a glTF file survive project, trimming and export, and are left out of edited
motion.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gltf_twins import Twin, chain
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from slow_gltf import SlowGltf
from strict_gltf import checked_glb

from enliven.deformation.skinning import skin_vertices
from enliven.document import CubicKeys, Project, Segment, character_of
from enliven.exporters import sample_performance
from enliven.exporters.gltf.write import build_glb
from enliven.formats.gltf.read import read_gltf
from enliven.formats.project.file import read_project, write_project
from enliven.formats.rig.rig import play_clip
from enliven.modeling.edits import move_character
from enliven.motion.layers.evaluate import Player
from enliven.oneshot.exportable import find_exportables


def turn(random: np.random.Generator, most: float) -> np.ndarray:
    """Returns a random rotation as a quaternion (x, y, z, w)."""
    axis, half = random.normal(size=3), random.uniform(0.1, most) / 2
    return np.append(np.sin(half) * axis / np.linalg.norm(axis), np.cos(half))


def curved(seed: int, start: float = 0.0) -> Twin:
    """Returns the chain below a rotated and shrunk node, with random cubic keys.

    Each joint rotates, and the first one moves. The joints have keys at different times. For odd seeds there
    is a rotated node between the second and the third joint that the bind pose does not contain. The third
    joint is therefore always off its bone.
    """
    random, twin = np.random.default_rng(seed), Twin()
    joints = chain(twin)
    scene = twin.json["scenes"][0]["nodes"]
    holder = twin.node(children=[joints[0]], rotation=turn(random, 2.0).tolist(), scale=[0.5] * 3)
    scene.remove(joints[0])
    if seed % 2:
        between = twin.node(rotation=turn(random, 0.5).tolist(), in_scene=False, children=[joints[2]])
        twin.json["nodes"][joints[1]]["children"] = [between]
    assert holder in scene
    for number, joint in enumerate(joints):
        count = int(random.integers(2, 6))
        gaps = random.uniform(0.1, 0.5, count - 1)
        times = start + 0.1 * number + np.concatenate([[0.0], np.cumsum(gaps)])
        twin.channel(0, {"node": joint, "path": "rotation"}, times, rows(random, count, 4), "CUBICSPLINE")
        if not number:
            places = rows(random, count, 3)
            twin.channel(0, {"node": joint, "path": "translation"}, times, places, "CUBICSPLINE")
    return twin


def rows(random: np.random.Generator, count: int, width: int) -> np.ndarray:
    """Returns (3 K, 4 or 3): the slope before each key, its value, and the slope after it."""
    values = random.normal(0.0, 0.3, (count, width))
    if width == 4:
        values = np.array([turn(random, 1.2) for _ in range(count)])
    slopes = random.normal(0.0, 0.7, (count, 2, width))
    return np.stack([slopes[:, 0], values, slopes[:, 1]], 1).reshape(-1, width)


def written(tmp_path: Path, performance) -> SlowGltf:
    data = build_glb([performance])
    checked_glb(data)
    (tmp_path / "out.glb").write_bytes(data)
    return SlowGltf(tmp_path / "out.glb")


def keys_of(slow: SlowGltf, path: str = "rotation") -> list[tuple[str, np.ndarray]]:
    """Returns the interpolation and the key times of each channel of a path."""
    animation = slow.json["animations"][0]
    channels = [channel for channel in animation["channels"] if channel["target"]["path"] == path]
    samplers = [animation["samplers"][channel["sampler"]] for channel in channels]
    return [(sampler["interpolation"], slow.accessor(sampler["input"])[:, 0]) for sampler in samplers]


def length_of(slow: SlowGltf) -> tuple[float, float]:
    inputs = [slow.accessor(sampler["input"])[:, 0] for sampler in slow.json["animations"][0]["samplers"]]
    return min(seconds[0] for seconds in inputs), max(seconds[-1] for seconds in inputs)


def tolerance(seed: int) -> float:
    """Returns metres: rounding to float32, or the error between frames of a joint that is off its bone."""
    return 2e-4 if seed % 2 else 1e-5


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 1.5]))
def test_cubic_keys_are_written_as_the_file_has_them(tmp_path_factory, seed, start) -> None:
    folder = tmp_path_factory.mktemp("cubic")
    path = curved(seed, start).write(folder / "a.glb")
    slow = SlowGltf(path)
    first, last = length_of(slow)
    again = written(folder, find_exportables(path).items[0].sample(0.0, None, None, False, True))
    for kind in ("rotation", "translation"):
        cubic = [after for how, after in keys_of(again, kind) if how == "CUBICSPLINE"]
        for (_, before), after in zip(keys_of(slow, kind), cubic, strict=True):
            np.testing.assert_allclose(after, before - first, atol=1e-6)
    for seconds in np.linspace(first, last, 23):
        expected = slow.vertices_at(0, seconds)
        np.testing.assert_allclose(
            again.vertices_at(0, seconds - first), expected, atol=5e-6 if seed % 2 == 0 else 2e-4
        )


@example(seed=121, first=0.125, last=0.25, speed=1.0)  # no key of a bone is between these times
@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.02, 0.15), st.floats(0.25, 0.45), st.sampled_from([1.0, 2.0, 0.4]))
def test_trimmed_and_slowed_clips_keep_their_cubic_keys(tmp_path_factory, seed, first, last, speed) -> None:
    folder = tmp_path_factory.mktemp("trimmed")
    path = curved(seed).write(folder / "a.glb")
    rig, slow = read_gltf(path), SlowGltf(path)
    # A few random curves turn too fast for frames at 120 Hz. They are sampled from the beginning.
    assume(len(rig.clips[0].cubic) == 4)
    project, shape = play_clip(Project(), rig.shape, rig.clips[0])
    segment = Segment(0.0, last - first, first)
    layers = tuple(replace(layer, segments=(segment,), speed=speed, offset=0.5) for layer in shape.layers)
    shape = shape.with_changes(layers=layers)
    project = project.with_characters(shape)
    write_project(folder / "b.enliven", project)
    project = read_project(folder / "b.enliven")
    length = (last - first) / speed
    reread = written(
        folder, sample_performance(project, shape.id, 0.5, 0.5 + length, 20 / length, keyed=True)
    )
    assert [how for how, _ in keys_of(reread)].count("CUBICSPLINE") == 3
    for share in np.linspace(0.0, 1.0, 11):
        expected = slow.vertices_at(0, first + share * (last - first))
        seconds = share * (last - first) / speed
        np.testing.assert_allclose(
            reread.vertices_at(0, seconds), expected, atol=1e-5 if seed % 2 == 0 else 2e-4
        )


def test_a_motion_that_was_edited_is_sampled(tmp_path: Path) -> None:
    path = curved(3).write(tmp_path / "a.glb")
    rig = read_gltf(path)
    project, shape = play_clip(Project(), rig.shape, rig.clips[0])
    posed = shape.modeling.copy()
    posed[2] = [np.cos(0.05), 0.0, 0.0, np.sin(0.05)]
    edits = {
        "posed": shape.with_changes(modeling=posed),
        "half": shape.with_changes(layers=tuple(replace(layer, weight=0.5) for layer in shape.layers)),
        "later": shape.with_changes(layers=(replace(shape.layers[0], offset=0.3), *shape.layers[1:])),
        "looped": shape.with_changes(layers=tuple(replace(layer, loop=True) for layer in shape.layers)),
        "smooth": shape.with_changes(layers=tuple(replace(layer, smooth=0.2) for layer in shape.layers)),
    }
    for name, edited in edits.items():
        performance = sample_performance(
            project.with_characters(edited), edited.id, 0.0, 0.6, 240.0, keyed=True
        )
        assert len(performance.cubic) == (3 if name == "posed" else 0), f"{name}: what was posed is sampled"
        player, reread = Player(project.with_characters(edited), edited.id), written(tmp_path, performance)
        for seconds in (0.0, 0.25, 0.6):
            shown = skin_vertices(character_of(edited), player.compute_message_pose(seconds))
            np.testing.assert_allclose(reread.vertices_at(0, seconds), shown, atol=1e-3, err_msg=name)


def test_a_character_that_was_moved_is_written_where_it_is(tmp_path: Path) -> None:
    path = curved(4).write(tmp_path / "a.glb")
    rig, slow = read_gltf(path), SlowGltf(path)
    project, shape = play_clip(Project(), rig.shape, rig.clips[0])
    project = move_character(project, shape.id, [1.0, 0.0, 0.0])
    again = written(tmp_path, sample_performance(project, shape.id, 0.0, 0.4, 120.0, keyed=True))
    for seconds in (0.0, 0.2, 0.4):
        expected = slow.vertices_at(0, seconds) + np.array([1.0, 0.0, 0.0])
        np.testing.assert_allclose(again.vertices_at(0, seconds), expected, atol=2e-3)


@pytest.mark.parametrize("width", [3, 4])
def test_a_cut_curve_is_the_curve(width: int) -> None:
    random = np.random.default_rng(width)
    given = rows(random, 6, width).reshape(6, 3, width)
    whole = CubicKeys(0, np.cumsum(random.uniform(0.1, 0.4, 6)), given[:, 1], given[:, ::2])
    for first, last in ((0.3, 1.1), (whole.seconds[1], whole.seconds[3]), (0.41, 0.42), (-1.0, 9.0)):
        cut = whole.cut(first, last)
        seconds = np.linspace(max(first, whole.seconds[0]), min(last, whole.seconds[-1]), 101)
        np.testing.assert_allclose(cut.evaluate(seconds), whole.evaluate(seconds), atol=2e-6)
    same = whole.cut(whole.seconds[1], whole.seconds[3])
    assert (same.seconds == whole.seconds[1:4]).all() and (
        same.values[1] == whole.evaluate(whole.seconds[2:3])
    ).all()
