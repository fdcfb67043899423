"""Tests of painting stiff and soft regions: strokes, symmetry, undo, and messages to the stage."""

from __future__ import annotations

import numpy as np
import pytest
from known_bodies import t_pose

from enliven.deformation.graph.stiffness import compute_painted_stiffness
from enliven.document.project import are_identical
from enliven.formats.project.file import read_project, write_project
from enliven.formats.project.one_character import character_bytes, project_of_mesh
from enliven.person import Body, Joint
from enliven.wire import PutCharacter
from enliven_edge.settings import EdgeSettings
from enliven_edge.uploaded_actor import create_uploaded_actor
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.paint.paint_tool import PaintTool, make_shades
from enliven_viewer.studio.features.perform.staged_characters import differs_in_motion_only
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.workspace.workspace import Workspace

KNOWN = t_pose()
LEFT, RIGHT = ([Joint.ELBOW_LEFT, Joint.WRIST_LEFT], [Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT])


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    settings = StudioSettings(render=RenderSettings(shadow_size=64, contact_size=32, samples=1))
    opened = Workspace(Editor(project=project_of_mesh(KNOWN.mesh, "man"), settings=settings), tmp_path)
    opened.editor.select_only("man")
    opened.editor.frame_all(at_once=True)
    return opened


def stroke(workspace: Workspace, joints: list[int], **held: bool) -> None:
    """Draws a stroke over the surface in front of some joints, with the current brush."""
    tool = workspace.input.tools["paint"]
    pixels = tool.editor.lens.project(KNOWN.joints[joints])[0]
    ways = [tuple(pixels[0] + share * (pixels[-1] - pixels[0])) for share in np.linspace(0, 1, 9)]
    workspace.input.move(ways[0])
    workspace.input.press(ways[0], **held)
    for at in ways[1:]:
        workspace.input.move(at, **held)
    workspace.input.release(ways[-1], **held)


def painted(workspace: Workspace) -> np.ndarray:
    mesh = workspace.editor.project.character("man").mesh
    return np.ones(len(mesh.vertices)) if mesh.stiffness is None else mesh.stiffness


def near(joints: list[int], metres: float = 0.12) -> np.ndarray:
    """Returns (V,) flags of the vertices near a limb."""
    a, b = KNOWN.joints[joints]
    along = np.clip((KNOWN.mesh.vertices - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(KNOWN.mesh.vertices - (a + along[:, None] * (b - a)), axis=1) < metres


def test_strokes_paint_the_limb_that_they_go_over_and_are_undone_bit_for_bit(workspace):
    first = workspace.editor.project
    assert workspace.actions.do("paint.softer") and isinstance(workspace.input.tool, PaintTool)
    stroke(workspace, LEFT)
    soft = painted(workspace)
    assert soft[near(LEFT, 0.04)].max() < 0.8 and (soft[near(RIGHT)] == 1).all()
    stroke(workspace, RIGHT, ctrl=True)
    stiff = painted(workspace)
    assert stiff[near(RIGHT, 0.04)].min() > 1.2, "Ctrl does the opposite"
    np.testing.assert_array_equal(stiff[near(LEFT)], soft[near(LEFT)])
    workspace.actions.do("paint.erase")
    stroke(workspace, RIGHT)
    assert painted(workspace).max() < stiff.max()
    for _ in range(3):
        workspace.actions.do("edit.undo")
    assert are_identical(workspace.editor.project, first)


def test_both_sides_are_painted_alike_and_the_brush_is_sized(workspace):
    tool = workspace.input.tools["paint"]
    workspace.actions.do("paint.stiffer")
    workspace.actions.do("paint.both_sides")
    before = tool.radius
    workspace.actions.do("paint.larger")
    workspace.actions.do("paint.smaller")
    assert tool.radius == pytest.approx(before)
    stroke(workspace, LEFT)
    both = painted(workspace)
    assert both[near(LEFT, 0.05)].mean() == pytest.approx(both[near(RIGHT, 0.05)].mean(), rel=0.1)
    assert both[near(LEFT, 0.05)].mean() > 1.5
    assert len(tool.overlay().marks) > 2, "a ring is on the other side too"
    assert workspace.actions.do("paint.clear")
    assert workspace.editor.project.character("man").mesh.stiffness is None
    assert not workspace.actions.do("paint.clear"), "there is none left"


def test_the_stroke_is_seen_while_it_is_drawn_and_dropped_by_escape(workspace):
    workspace.actions.do("paint.softer")
    tool, editor = workspace.input.tool, workspace.editor
    at = tuple(editor.lens.project(KNOWN.joints[LEFT])[0][0])
    plain = tool.picture().shade[2]
    assert (plain == plain[0]).all()
    workspace.input.move(at)
    workspace.input.press(at)
    _, faces, tints = tool.picture().shade
    assert faces is KNOWN.mesh.faces or len(faces) == len(KNOWN.mesh.faces)
    assert (tints != plain).any(1).sum() > 5 and (tints == plain)[near(RIGHT)].all()
    workspace.input.key("escape")
    np.testing.assert_array_equal(tool.picture().shade[2], plain)
    assert editor.history.undo_name is None
    stiff, even, soft = (
        int(shade[2]) - int(shade[0]) for shade in make_shades(np.array([16.0, 1.0, 1 / 16], np.float32))
    )
    assert soft < -100 < abs(even) < 20 < 100 < stiff, "blue, grey and orange"


@pytest.mark.slow
def test_painted_stiffness_is_saved_and_softens_on_stage(workspace, tmp_path):
    workspace.actions.do("paint.softer")
    before = workspace.editor.project.character("man")
    for _ in range(2):
        stroke(workspace, LEFT)
    project = workspace.editor.project
    assert not differs_in_motion_only(project.character("man"), before), "it is sent anew"
    write_project(tmp_path / "soft.enliven", project)
    np.testing.assert_array_equal(
        read_project(tmp_path / "soft.enliven").character("man").mesh.stiffness, painted(workspace)
    )
    settings = EdgeSettings(nodes=64)
    shown = {}
    for name, variant in (("soft", project), ("plain", project.with_characters(before))):
        data = character_bytes(variant, "man")
        actor = create_uploaded_actor(data, PutCharacter("man", 1, b"x" * 32, len(data), True), settings)
        shown[name] = wave(actor)
        factors = compute_painted_stiffness(actor.character)
        assert (factors is None) == (name == "plain")
        if factors is not None:
            rest, soft = actor.graph.positions, factors < 0.5
            assert 2 <= soft.sum() < 20 and np.abs(rest[soft, 0]).min() > 0.15
    distances = np.linalg.norm(shown["soft"] - shown["plain"], axis=2)
    assert distances[:, soft].max() > 0.03, "the soft arm swings past the other"
    assert distances[:, np.abs(rest[:, 0]) < 0.1].max() < 0.5 * distances[:, soft].max()


def wave(actor) -> np.ndarray:
    """Returns (F, N, 3) node positions while a performer waves the left arm and stops."""
    frames = []
    for k in range(30):
        joints = KNOWN.joints.copy()
        turn = 0.6 * np.sin(min(k, 15) * 0.5)
        arm = [Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.HAND_LEFT]
        way = joints[arm] - joints[Joint.SHOULDER_LEFT]
        joints[arm] = joints[Joint.SHOULDER_LEFT] + way @ np.array(
            [[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
        )
        body = Body(1, joints, np.ones(20), stature=1.75)
        frames.append(actor.perform([body], (k + 1) * 33_333_333).positions)
        if k == 0:
            actor.possess(body)
    return np.array(frames)
