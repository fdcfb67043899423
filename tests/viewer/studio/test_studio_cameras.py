"""Tests of the studio's camera: F keeps the viewing direction, and a followed character stays in view."""

from __future__ import annotations

import numpy as np

from enliven.document import GraphPart, PoseStream, Project, graph_shape_at_rest
from enliven.modeling.edits import compute_vertices, move_character
from enliven.samples.shipped import load_sample
from enliven_viewer.render.stage_look import LOOKS
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.workspace.workspace import Workspace


def settle(editor: Editor, seconds: float = 3.0) -> None:
    for _ in range(int(seconds / 0.05)):
        editor.advance(0.05)


def workspace_of(make_limb) -> Workspace:
    project = Project().with_characters(make_limb("walker"), make_limb("stayer", at=(0.6, 0.2, 0.0)))
    return Workspace(Editor(StudioSettings(), project))


def seen(editor: Editor, name: str) -> float:
    """Returns a character's distance from the centre of the image, where 1 is the edge."""
    posed = editor.stage_character(name)
    aspect = editor.size[0] / editor.size[1]
    return float(np.abs(editor.camera.view(aspect).project(posed.vertices)).max())


def test_f_frames_everything_from_the_side_that_was_chosen(make_limb) -> None:
    workspace = workspace_of(make_limb)
    editor = workspace.editor
    editor.camera.face(2.0, 0.9)
    settle(editor)
    before = editor.camera.view(1.5).camera_from_world[:3, :3]
    workspace.input.key("f")
    settle(editor)
    np.testing.assert_allclose(editor.camera.view(1.5).camera_from_world[:3, :3], before, atol=1e-6)
    assert max(seen(editor, "walker"), seen(editor, "stayer")) < 1


def test_the_chosen_character_is_followed_when_it_walks_off_and_not_when_it_is_switched_off(
    make_limb,
) -> None:
    for follow in (True, False):
        workspace = workspace_of(make_limb)
        editor = workspace.editor
        workspace.input.key("f")
        settle(editor)
        editor.select_only("walker")
        if follow:
            workspace.input.key("shift+f")
        for _ in range(60):
            editor.edit("walk", lambda project: move_character(project, "walker", [0.1, 0.0, 0.0]))
            editor.advance(1 / 30)
            assert seen(editor, "walker") < 1 or not follow
        assert (seen(editor, "walker") < 1) == follow


def test_looks_come_in_turn_and_come_back(make_limb) -> None:
    workspace = workspace_of(make_limb)
    begin = workspace.editor.look
    looks = []
    for _ in LOOKS:
        workspace.input.key("shift+l")
        looks.append(workspace.editor.look)
    assert set(looks) == set(LOOKS) and looks[-1] == begin


def test_ctrl_f_frames_the_whole_path_and_f_the_current_pose() -> None:
    mesh = load_sample("chair")
    rest, far = np.zeros((1, 3)), np.array([[4.0, 0.0, 0.0]])
    shape, still = graph_shape_at_rest("chair", rest, np.zeros((0, 2), np.int32), mesh)
    walk = PoseStream("walk", np.tile(np.eye(3), (2, 1, 1, 1)), np.stack([rest, far]), 2.0)
    walker = shape.with_changes(id="walker", parts=(GraphPart("walk", np.arange(1)),))
    project = Project().with_streams(still, walk).with_characters(shape, walker)
    workspace = Workspace(Editor(project=project))
    editor = workspace.editor
    editor.size = (800.0, 600.0)
    ends = [compute_vertices(project, "walker", time) for time in (0.0, 1.0, 2.0)]
    for key, chosen, whole in (
        ("f", ("walker",), False),
        ("ctrl+f", ("walker",), True),
        ("ctrl+f", ("chair",), False),
        ("ctrl+f", (), True),
    ):
        editor.choose_all(*chosen)
        workspace.input.key(key)
        editor.camera.advance(np.inf)
        assert inside(editor, ends[0])
        assert inside(editor, np.concatenate(ends)) is whole, (key, chosen)


def inside(editor: Editor, points) -> bool:
    """Returns True if all points are in the image."""
    pixels = editor.lens.project(points)[0]
    return bool(((pixels >= 0) & (pixels <= editor.size)).all())
