"""Possessed meshes in the studio: chosen, moved, cut, merged, copied; and read from a recorded take."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from enliven.document.character import Character, Pose, SkinWeights
from enliven.document.possessed import graph_shape_of
from enliven.document.project import Project, same
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.session import Click, DeskStage, Drag, Key, Pixel, Spot, Wait, play
from enliven_viewer.studio.workspace.workspace import Desk

NS = 1_000_000_000


@pytest.fixture
def desk(make_limb, tmp_path) -> Desk:
    """A desk with two possessed posts that rock."""
    project = Project()
    for name, x in (("post", 0.0), ("other", 0.8)):
        limb = make_limb(name, 4, 1.2, (x, 0.1, 0.0))
        nodes = limb.skeleton.positions.astype(np.float32)
        skin = SkinWeights(limb.skin.indices, limb.skin.weights)
        edges = np.stack([np.arange(4), np.arange(1, 5)], 1).astype(np.int32)
        vertices = limb.mesh.vertices.astype(np.float32)
        character = Character(name, vertices, limb.mesh.faces, skin, nodes, edges)
        poses = []
        for frame in range(30):
            moved = nodes + np.float32([0.1 * np.sin(frame / 5), 0, 0]) * (nodes[:, 1:2] - 0.1)
            linear = np.tile(np.eye(3, dtype=np.float32), (5, 1, 1))
            poses.append(Pose(name, frame * NS // 30, linear, moved.astype(np.float32)))
        shape, stream = graph_shape_of(character, poses, name)
        project = project.with_streams(stream).with_graphs(shape)
    made = Desk.new(Editor(), tmp_path)
    made.cabinet.new(project)
    return made


def do(desk: Desk, *actions) -> Desk:
    play([Key("1"), Wait(1.0), *actions], DeskStage(desk))
    return desk


def vertices(desk: Desk) -> dict[str, np.ndarray]:
    return {mesh.shape.id: mesh.vertices for mesh in desk.editor.possessed}


def test_a_click_chooses_it_and_another_forgets_it(desk: Desk) -> None:
    do(desk, Click(Spot(0.0, 0.7)))
    assert desk.editor.selection.graph == "post" and desk.editor.selection.shape is None
    do(desk, Click(Pixel(0.04, 0.2)))
    assert desk.editor.selection.graph is None


def test_it_plays_as_long_as_it_was_recorded(desk: Desk) -> None:
    assert desk.editor.length == desk.editor.settings.shortest
    before = vertices(desk)["post"]
    desk.editor.scrub(0.5)
    assert np.abs(vertices(desk)["post"] - before).max() > 0.01


def test_it_is_moved_at_every_time(desk: Desk) -> None:
    before = vertices(desk)["post"]
    do(desk, Key("g"), Drag((Spot(0.0, 0.7), Spot(0.0, 1.1))))
    assert desk.editor.history.names == ("move post",)
    assert np.allclose(vertices(desk)["post"] - before, [0.0, 0.4, 0.0], atol=0.03)


def test_a_stroke_cuts_it_and_both_parts_move_as_before(desk: Desk) -> None:
    desk.editor.scrub(0.3)
    before = vertices(desk)["post"]
    do(desk, Key("c"), Drag((Spot(-0.2, 0.62), Spot(0.2, 0.66))))
    assert set(desk.editor.project.graphs) == {"post", "other", "post 2"}, desk.editor.toasts.shown
    parts = vertices(desk)
    assert parts["post"].max(0)[1] < 0.75 < parts["post 2"].max(0)[1]
    kept = np.concatenate([parts["post"], parts["post 2"]])
    away = np.linalg.norm(before[:, None] - kept[None], axis=2).min(1)
    assert away.max() < 1e-6, "every vertex is where it was"


def test_a_stroke_beside_it_says_so_and_changes_nothing(desk: Desk) -> None:
    before = desk.editor.project
    do(desk, Click(Spot(0.0, 0.7)), Key("c"), Drag((Pixel(0.05, 0.2), Pixel(0.1, 0.4))))
    assert desk.editor.project is before and desk.editor.toasts.shown[-1].bad


def test_with_shift_two_become_one(desk: Desk) -> None:
    do(desk, Key("g"), Drag((Spot(0.8, 0.7), Spot(0.03, 0.9)), shift=True))
    assert list(desk.editor.project.graphs) == ["post"], desk.editor.toasts.shown
    assert desk.editor.selection.graph == "post"
    desk.editor.undo()
    assert set(desk.editor.project.graphs) == {"post", "other"}


def test_it_is_copied_and_deleted(desk: Desk) -> None:
    first = desk.editor.project
    do(desk, Click(Spot(0.0, 0.7)), Key("ctrl+d"))
    assert len(desk.editor.project.graphs) == 3
    do(desk, Click(Spot(0.0, 0.7)), Key("delete"))
    assert "post" not in desk.editor.project.graphs
    desk.editor.undo()
    desk.editor.undo()
    assert same(desk.editor.project, first)


def test_a_recorded_take_brings_what_was_possessed(tmp_path, box) -> None:
    spec = importlib.util.spec_from_file_location("takes", Path(__file__).parents[1] / "test_takes.py")
    assert spec is not None and spec.loader is not None
    takes = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(takes)
    takes.write(tmp_path / "evening.mcap", box)
    desk = Desk.new(Editor(), tmp_path)
    desk.open(tmp_path / "evening.mcap")
    assert list(desk.editor.project.graphs) == ["box"] and desk.editor.history.names == ("open evening.mcap",)
    first = vertices(desk)["box"]
    desk.editor.scrub(desk.editor.length)
    assert np.abs(vertices(desk)["box"] - first).max() > 1e-4


def test_possessed_meshes_go_out_as_glb(desk: Desk, tmp_path) -> None:
    desk.asking = "export"
    desk.chosen(tmp_path / "posts.glb")
    assert (tmp_path / "posts.glb").stat().st_size > 1000 and "2 shapes" in desk.editor.toasts.shown[-1].text
