"""Tests of possessed meshes in the studio: selected, moved, cut, merged, copied, and read from a take."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sample_meshes.chair import make_chair
from studio_driver import Action, Click, Drag, HeadlessStage, Key, Pixel, Spot, Wait, play, steps
from swaying import possessed_chair, without_cache

from enliven.document import graph_shape_from_poses
from enliven.document.character import Character, Pose, SkinWeights
from enliven.document.project import Project, are_identical
from enliven.formats.project.one_character import project_of_mesh
from enliven.modeling.edits import (
    compute_vertices,
    cut_character,
    delete_character,
    find_base_centre,
    move_character,
    paste_character,
    scale_character,
)
from enliven.modeling.mesh.cut_surfaces import PlaneCut
from enliven.modeling.possessed.solving import stale
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.viewport.overlay import Label
from enliven_viewer.studio.workspace.workspace import Workspace

NS = 1_000_000_000


@pytest.fixture
def workspace(make_limb, tmp_path) -> Workspace:
    """Returns a workspace with two possessed posts that swing."""
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
        shape, stream = graph_shape_from_poses(character, poses, name)
        project = project.with_streams(stream).with_characters(shape)
    opened = Workspace.new(Editor(), tmp_path)
    opened.store.new(project)
    return opened


def do(workspace: Workspace, *actions) -> Workspace:
    play([Key("1"), Wait(1.0), *actions], HeadlessStage(workspace))
    return workspace


def vertices(workspace: Workspace) -> dict[str, np.ndarray]:
    return {posed.id: posed.vertices for posed in workspace.editor.stage_characters}


def test_click_selects_the_mesh_and_click_outside_deselects(workspace: Workspace) -> None:
    do(workspace, Click(Spot(0.0, 0.7)))
    assert workspace.editor.selection.character == "post" and workspace.editor.selection.handle is None
    do(workspace, Click(Pixel(0.04, 0.2)))
    assert workspace.editor.selection.character is None


def test_possessed_mesh_plays_its_recording(workspace: Workspace) -> None:
    assert workspace.editor.length == workspace.editor.settings.shortest
    before = vertices(workspace)["post"]
    workspace.editor.scrub(0.5)
    assert np.abs(vertices(workspace)["post"] - before).max() > 0.01


def test_possessed_mesh_is_moved_at_every_time(workspace: Workspace) -> None:
    before = vertices(workspace)["post"]
    do(workspace, Key("g"), Drag((Spot(0.0, 0.7), Spot(0.0, 1.1))))
    assert workspace.editor.history.names == ("move post",)
    assert np.allclose(vertices(workspace)["post"] - before, [0.0, 0.4, 0.0], atol=0.03)


def test_stroke_cuts_the_mesh_and_both_parts_keep_moving(workspace: Workspace) -> None:
    workspace.editor.scrub(0.3)
    before = vertices(workspace)["post"]
    do(workspace, Key("c"), Drag((Spot(-0.2, 0.62), Spot(0.2, 0.66))))
    assert set(workspace.editor.project.graphs) == {"post", "other", "post 2"}, workspace.editor.toasts.shown
    parts = vertices(workspace)
    assert parts["post 2"].max(0)[1] < 0.75 < parts["post"].max(0)[1], "the larger part keeps the name"
    kept = np.concatenate([parts["post"], parts["post 2"]])
    away = np.linalg.norm(before[:, None] - kept[None], axis=2).min(1)
    assert away.max() < 1e-6, "every vertex is where it was"


def test_stroke_outside_the_mesh_is_refused(workspace: Workspace) -> None:
    before = workspace.editor.project
    do(workspace, Click(Spot(0.0, 0.7)), Key("c"), Drag((Pixel(0.05, 0.2), Pixel(0.1, 0.4))))
    assert workspace.editor.project is before and workspace.editor.toasts.shown[-1].is_error


def test_shift_drag_merges_two_meshes(workspace: Workspace) -> None:
    do(workspace, Key("g"), Drag((Spot(0.8, 0.7), Spot(0.03, 0.9)), shift=True))
    assert list(workspace.editor.project.graphs) == ["post"], workspace.editor.toasts.shown
    assert workspace.editor.selection.character == "post"
    workspace.editor.undo()
    assert set(workspace.editor.project.graphs) == {"post", "other"}


def test_touching_drop_merges_whatever_is_under_the_pointer(workspace: Workspace) -> None:
    """The pointer is over the dragged mesh's own top, which hides the other mesh."""
    low = vertices(workspace)["other"][:, 0].min() - vertices(workspace)["post"][:, 0].max()
    drag = Drag((Spot(0.8, 1.29), Spot(0.8 - low - 0.02, 1.34)), shift=True)
    do(workspace, Key("g"), drag)
    assert list(workspace.editor.project.graphs) == ["post"], workspace.editor.toasts.shown


def test_shift_shows_the_merge_target(workspace: Workspace) -> None:
    stage, marks = HeadlessStage(workspace), list[str]()

    def watched() -> Iterator[Action]:
        yield from (Key("1"), Wait(1.0), Key("g"))
        yield Drag((Spot(0.8, 0.7), Spot(0.03, 0.9)), 0.4, shift=True)

    for _ in steps(watched(), stage):
        overlay = workspace.input.tool.overlay()
        marks += [mark.text for mark in overlay.marks if isinstance(mark, Label)]
    assert marks and set(marks) == {"merge with post"}


def test_shift_drop_in_empty_space_moves_the_mesh_with_a_note(workspace: Workspace) -> None:
    do(workspace, Key("g"), Drag((Spot(0.8, 0.7), Spot(0.6, 0.75)), shift=True))
    assert workspace.editor.history.names == ("move other",)
    assert workspace.editor.toasts.shown[-1].text == "No shape is near other"
    do(workspace, Click(Spot(0.0, 0.7)), Key("delete"))
    do(workspace, Key("g"), Drag((Spot(0.6, 0.75), Spot(0.7, 0.75)), shift=True))
    assert workspace.editor.toasts.shown[-1].text == "You need a second shape to merge"


def test_possessed_mesh_is_copied_and_deleted(workspace: Workspace) -> None:
    first = workspace.editor.project
    do(workspace, Click(Spot(0.0, 0.7)), Key("ctrl+d"))
    assert len(workspace.editor.project.graphs) == 3
    do(workspace, Click(Spot(0.0, 0.7)), Key("delete"))
    assert "post" not in workspace.editor.project.graphs
    workspace.editor.undo()
    workspace.editor.undo()
    assert are_identical(workspace.editor.project, first)


def test_recorded_take_contains_the_possessed_mesh(tmp_path, box) -> None:
    path = Path(__file__).parents[1] / "link" / "test_takes.py"
    spec = importlib.util.spec_from_file_location("takes", path)
    assert spec is not None and spec.loader is not None
    takes = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(takes)
    takes.write(tmp_path / "evening.mcap", box)
    workspace = Workspace.new(Editor(), tmp_path)
    workspace.open(tmp_path / "evening.mcap")
    assert list(workspace.editor.project.graphs) == ["box"] and workspace.editor.history.names == (
        "open evening.mcap",
    )
    assert workspace.editor.selection.characters == ("box",), "what was opened is chosen"
    first = vertices(workspace)["box"]
    workspace.editor.scrub(workspace.editor.length)
    assert np.abs(vertices(workspace)["box"] - first).max() > 1e-4


def test_possessed_meshes_go_out_as_glb(workspace: Workspace, tmp_path) -> None:
    workspace.asking = "export"
    workspace.finish_file_dialog(tmp_path / "posts.glb")
    workspace.editor.background.finish()
    assert (tmp_path / "posts.glb").stat().st_size > 1000 and "2 shapes" in workspace.editor.toasts.shown[
        -1
    ].text


def test_performers_reattach_after_a_cut_and_undo_reverts_it(tmp_path: Path) -> None:
    """This also holds for a file without the motion, which is solved when the file is opened."""
    project, name = possessed_chair(frames=20)
    opened = Workspace.new(Editor(), tmp_path)
    opened.store.new(without_cache(project, name))
    opened.store.save(tmp_path / "lost.enliven")
    opened.store.open(tmp_path / "lost.enliven")
    editor = opened.editor
    assert not stale(editor.project, editor.project.graph(name))
    rest = editor.project.graph(name).mesh.vertices
    plane = PlaneCut(rest.mean(0), [0.0, 1.0, 0.0])
    editor.edit("cut", lambda project: cut_character(project, name, plane, 0.0)[0])
    cut = editor.project
    assert stale(cut, cut.graph(name))
    editor.select_only(name)
    opened.commands.motion.solve_again()
    editor.background.finish()
    assert not stale(editor.project, editor.project.graph(name))
    assert editor.history.names[-1] == f"solve again {name}"
    editor.undo()
    assert are_identical(editor.project, cut)


@pytest.mark.slow
def test_performance_is_copied_onto_another_mesh_by_two_keys(workspace: Workspace) -> None:
    """The performers possess the selected mesh in the background. Later edits are kept."""
    editor = workspace.editor
    source, performed = possessed_chair(frames=15)
    stool = project_of_mesh(replace(make_chair(0.09), name="stool"), "stool")
    for project, name in ((source, performed), (stool, "stool")):
        editor.edit("paste", lambda before, p=project, n=name: paste_character(before, p, n)[0])
    editor.edit("move", lambda project: move_character(project, "stool", [2.0, 0.0, 0.0]))
    paste, copy = workspace.actions["motion.paste"], workspace.actions["motion.copy"]
    assert "No motion was copied" in paste.why_not()
    editor.select_only("post")
    assert "a performed mesh" in copy.why_not(), "the post was never performed"
    editor.select_only(performed)
    stage = HeadlessStage(workspace)
    play([Key("ctrl+shift+c")], stage)
    editor.select_only("stool")
    before = editor.project
    play([Key("ctrl+shift+v")], stage)
    editor.edit("scale", lambda project: scale_character(project, "stool", 1.5))
    editor.background.finish()
    assert editor.history.names[-1] == "scale" and "was changed" in editor.toasts.shown[-1].text
    editor.undo()
    assert are_identical(editor.project, before)
    play([Key("ctrl+shift+v")], stage)
    editor.background.finish()
    assert editor.history.names[-1] == f"give {performed} to stool"
    seen = [compute_vertices(editor.project, "stool", time) for time in (0.0, 0.4)]
    assert np.abs(seen[1] - seen[0]).max() > 0.02
    assert abs(find_base_centre(seen[0])[0] - 2.0) < 0.2
    editor.undo()
    assert are_identical(editor.project, before)
    editor.select_only(performed)
    editor.edit("delete", lambda project: delete_character(project, performed))
    editor.select_only("stool")
    play([Key("ctrl+shift+v")], stage)
    assert "no longer exists" in editor.toasts.shown[-1].text
