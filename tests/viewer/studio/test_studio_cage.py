"""Tests that a rig unknown to the studio can be played, selected, posed, moved, cut and exported."""

from __future__ import annotations

import numpy as np
import pytest
from cage import Cage, Swing, cage_of
from studio_driver import Click, Drag, HeadlessStage, Key, Near, OnTimeline, Spot, Wait, play

from enliven.document import PoseStream
from enliven.document.project import Project, are_identical
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.studio.workspace.workspace import Workspace


@pytest.fixture
def workspace(make_limb, tmp_path) -> Workspace:
    """Returns a post in a cage that swings to the right and back."""
    ways = 0.3 * np.sin(np.linspace(0.0, np.pi, 31))[:, None, None] * np.ones((1, 4, 1)) * [1.0, 0.0, 0.0]
    stream = PoseStream("swing", np.tile(np.eye(3), (31, 4, 1, 1)), ways, 0.1)
    mesh = make_limb("post", 4, 1.2, (0.0, 0.1, 0.0)).mesh
    cage = cage_of(mesh, "post", (Swing("swing"),))
    opened = Workspace.new(Editor(), tmp_path)
    opened.store.new(Project().with_streams(stream).with_characters(cage))
    return opened


def do(workspace: Workspace, *actions) -> Workspace:
    play([Key("1"), Wait(1.0), *actions], HeadlessStage(workspace))
    return workspace


def cage(workspace: Workspace) -> Cage:
    return workspace.editor.project.character("post", Cage)


def test_custom_rig_plays_and_its_lane_is_dragged_and_muted(workspace: Workspace) -> None:
    timeline, before = workspace.state(TimelineInput), workspace.editor.stage_character("post").vertices
    assert workspace.editor.length == pytest.approx(3.0)
    workspace.editor.scrub(1.5)
    way = workspace.editor.stage_character("post").vertices - before
    assert np.allclose(way, [0.3, 0.0, 0.0], atol=1e-6), "it is where the rig says"
    assert [bar.label for bar in timeline.layout.bars()] == ["post"]
    do(workspace, Drag((OnTimeline(0.5, 0), OnTimeline(1.1, 0))))
    assert cage(workspace).layers[0].offset == pytest.approx(0.6, abs=0.02)
    assert workspace.editor.selection.layer == 0 and workspace.editor.selection.character == "post"
    layout = timeline.layout
    timeline.press(5.0, layout.bars()[0].top + 8.0)
    timeline.release(5.0)
    assert cage(workspace).layers[0].muted and workspace.editor.history.names == ("move clip", "mute")


def test_a_corner_is_chosen_and_dragged_where_the_pointer_goes(workspace: Workspace) -> None:
    workspace.editor.scrub(1.5)
    before = workspace.editor.stage_character("post").handles[1:2]
    corner = Spot(*before[0])
    do(workspace, Click(corner))
    assert workspace.editor.selection.handle == 1
    do(workspace, Key("r"), Drag((corner, Near(corner, 40, -25))))
    places = np.concatenate([before, workspace.editor.stage_character("post").handles[1:2]])
    start, end = workspace.editor.lens.project(places)[0]
    assert np.abs(end - start - [40, -25]).max() < 2.0 and np.abs(cage(workspace).bent[1]).max() > 0.01
    assert not cage(workspace).bent[[0, 2, 3]].any() and workspace.editor.history.names == ("pose post",)


def test_custom_rig_is_moved_copied_mirrored_cut_and_exported(workspace: Workspace, tmp_path) -> None:
    first, editor = workspace.editor.project, workspace.editor
    do(workspace, Click(Spot(0.0, 0.7)), Key("ctrl+d"), Key("ctrl+m"), Key("ctrl+equal"), Key("f"), Wait(1.0))
    assert list(editor.project.characters) == ["post", "post 2"] and editor.selection.character == "post 2"
    assert len(editor.history.names) == 3
    do(workspace, Key("q"), Click(Spot(0.0, 0.7)), Key("c"), Drag((Spot(-0.2, 0.62), Spot(0.2, 0.66))))
    assert list(editor.project.characters) == ["post", "post 2", "post 3"], editor.toasts.shown
    workspace.asking = "export"
    workspace.finish_file_dialog(tmp_path / "posts.glb")
    editor.background.finish()
    assert "Wrote 3 shapes" in editor.toasts.shown[-1].text
    while editor.history.undo_name is not None:
        editor.undo()
    assert are_identical(editor.project, first)
