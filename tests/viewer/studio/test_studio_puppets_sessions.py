"""Tests of working with puppets by the studio's own tools and keys, without a window."""

from __future__ import annotations

from time import sleep

import numpy as np
import pytest
from made_studio_puppets import star, studio, vertex
from studio_driver import (
    STEP,
    Click,
    Do,
    Drag,
    Key,
    Near,
    OnPuppet,
    Pixel,
    Spot,
    Wait,
    play,
)
from tolerances import SOLVER_TOLERANCE, are_alike

from enliven.document.project import are_identical
from enliven.formats.project.file import read_project, write_project
from enliven.meshes.mesh import refine
from enliven.modeling.puppet.edits import make_puppet, play_take
from enliven.modeling.puppet.points import add_point, change_point
from enliven.modeling.puppet.poses import add_key_pose
from enliven_viewer.studio.features.puppets.puppet_commands import PuppetCommands
from enliven_viewer.studio.features.puppets.puppet_tool import PuppetTool
from enliven_viewer.studio.puppets.puppet_editor import PuppetEditor, get_puppet_editor
from enliven_viewer.studio.workspace.workspace import Workspace


def find_puppets(workspace: Workspace) -> PuppetEditor:
    """Returns the puppet editor of a workspace."""
    return get_puppet_editor(workspace.editor)


def tool_of(workspace: Workspace) -> PuppetTool:
    tool = workspace.input.tools["puppet"]
    assert isinstance(tool, PuppetTool)
    return tool


def two_poses(workspace: Workspace) -> None:
    """Returns the selected star's first two key poses: at rest, and bent to its left."""
    rest = find_puppets(workspace).puppet.rest
    bent = rest + np.linspace(0.0, 0.3, len(rest))[::-1, None] * [1.0, 0.3, 0.0]
    for time, places in ((0.0, rest), (0.8, bent)):
        workspace.editor.edit("pose", lambda p, t=time, q=places: add_key_pose(p, "star", "sway", t, q))


def bad(workspace: Workspace) -> list[str]:
    return [toast.text for toast in workspace.editor.toasts.shown if toast.is_error]


def test_clicks_put_control_points_and_a_drag_makes_a_key_pose(tmp_path) -> None:
    workspace, stage = studio(tmp_path, take="sway")
    hands = [OnPuppet("star", vertex(name)) for name in ("left", "right", "head")]
    tool_of(workspace).suggested.suggest_vertices(find_puppets(workspace).puppet)
    tool_of(workspace).suggested.wait()  # ends are on the silhouette, so their rings can be clicked
    play([*(Click(hand) for hand in hands), Do(lambda d: d.editor.scrub(1.0))], stage)
    puppet = find_puppets(workspace).puppet
    assert [np.linalg.norm(puppet.rest[k] - star().vertices[h.vertex]) < 0.03 for k, h in enumerate(hands)]
    assert find_puppets(workspace).point == 2 and not find_puppets(workspace).is_posing
    start = OnPuppet("star", point=0)
    play([Drag((start, Near(start, -10, -90)))], stage)
    puppet = find_puppets(workspace).puppet
    assert find_puppets(workspace).number == 0 and puppet.poses[0].time == pytest.approx(1.0)
    assert puppet.poses[0].places[0][1] > puppet.rest[0][1] + 0.1
    assert np.array_equal(puppet.poses[0].places[1:], puppet.rest[1:])
    play([Key("enter")], stage)
    assert not find_puppets(workspace).is_posing and not bad(workspace)


def test_arrows_move_along_their_axis(tmp_path) -> None:
    workspace, stage = studio(tmp_path, "head", "left", "foot", take="sway")
    workspace.editor.camera.orbit(0.4, 0.1)
    workspace.editor.camera.advance(10.0)
    play([Click(OnPuppet("star", point=1))], stage)
    manipulator = tool_of(workspace).manipulator()
    assert manipulator is not None
    tip = manipulator.place + np.array([0.0, 60.0, 0.0]) * manipulator.pixel
    play([Drag((Spot(*tip), Near(Spot(*tip), 12, -60)))], stage)
    way = find_puppets(workspace).places[1] - find_puppets(workspace).puppet.rest[1]
    assert way[1] > 0.05 and way[0] == way[2] == 0.0


def test_finger_grabs_an_arrow_from_farther_away_than_a_mouse(tmp_path) -> None:
    workspace, stage = studio(tmp_path, "head", "left", "foot", take="sway")
    play([Click(OnPuppet("star", point=1))], stage)
    gizmo, user_input = tool_of(workspace).manipulator(), workspace.input
    assert gizmo is not None
    tip = gizmo.place + np.array([0.0, 60.0, 0.0]) * gizmo.pixel
    x, y = workspace.editor.lens.project(tip[None])[0][0]
    for is_finger in (False, True):
        user_input.press((x + 17.0, y), is_finger=is_finger)
        assert (tool_of(workspace).held is not None) == is_finger
        user_input.key("escape")
        user_input.release((x + 17.0, y))
        workspace.editor.select_only("star", 1)
    assert gizmo.find_part((x + 11.0, y)) == "y"


def test_escape_goes_back_step_by_step_and_loses_nothing(tmp_path) -> None:
    workspace, stage = studio(tmp_path, "head", "left", take="sway")
    start = OnPuppet("star", point=1)
    play([Drag((start, Near(start, 0, -60)))], stage)
    kept = find_puppets(workspace).puppet.poses
    user_input = workspace.input
    at = workspace.editor.lens.project(find_puppets(workspace).stage_puppets[0].handles)[0][1]
    user_input.press((at[0], at[1]))
    user_input.move((at[0] + 40, at[1]))
    assert find_puppets(workspace).is_dragging
    user_input.key("escape")
    assert not find_puppets(workspace).is_dragging and are_identical(
        find_puppets(workspace).puppet.poses, kept
    )
    user_input.move((at[0] + 80, at[1]))
    user_input.release((at[0] + 80, at[1]))
    assert are_identical(find_puppets(workspace).puppet.poses, kept), "what was dropped stays dropped"
    user_input.key("escape")
    assert find_puppets(workspace).point is None and find_puppets(workspace).is_posing
    user_input.key("escape")
    assert not find_puppets(workspace).is_posing and are_identical(find_puppets(workspace).puppet.poses, kept)


def test_another_tool_keeps_the_key_pose(tmp_path) -> None:
    workspace, stage = studio(tmp_path, "head", "left", take="sway")
    start = OnPuppet("star", point=1)
    play([Drag((start, Near(start, 0, -60)))], stage)
    kept = find_puppets(workspace).puppet
    play([Key("q")], stage)
    assert (
        not find_puppets(workspace).is_posing
        and find_puppets(workspace).puppet is kept
        and len(kept.poses) == 1
    )


def test_keys_nudge_reset_and_remove_the_chosen_point(tmp_path) -> None:
    workspace, stage = studio(tmp_path, "head", "left", "foot", take="sway")
    play(
        [Click(OnPuppet("star", point=1)), Do(lambda d: get_puppet_editor(d.editor).begin_pose("sway", 0.5))],
        stage,
    )
    time = workspace.editor.time
    play([Key("up"), Key("shift+up")], stage)
    rise = find_puppets(workspace).places[1][1] - find_puppets(workspace).puppet.rest[1][1]
    pixel = tool_of(workspace).manipulator().pixel
    assert rise == pytest.approx(11 * pixel, rel=0.1) and workspace.editor.time == time
    play([Key("r")], stage)
    assert (
        np.allclose(find_puppets(workspace).places[1], find_puppets(workspace).puppet.rest[1])
        and workspace.input.tool.name == "puppet"
    )
    play([Key("delete")], stage)
    assert [point.name for point in find_puppets(workspace).puppet.points] == ["head", "foot"]
    play([Key("enter"), Key("right")], stage)
    assert workspace.editor.time > time, "with nothing in the hand the arrows go through time"


def test_dragging_the_mesh_turns_the_view_and_puts_no_point(tmp_path) -> None:
    workspace, stage = studio(tmp_path, "head")
    before = workspace.editor.lens.view.eye.copy()
    belly = Spot(0.0, 0.5, 0.0)
    play([Drag((belly, Near(belly, 120, 10)))], stage)
    workspace.editor.advance(5.0)
    assert len(find_puppets(workspace).puppet.points) == 1
    assert np.linalg.norm(workspace.editor.lens.view.eye - before) > 0.2


def test_suggested_ends_are_clicked_nearly(tmp_path) -> None:
    workspace, stage = studio(tmp_path)
    tool = tool_of(workspace)
    tool.suggested.suggest_vertices(find_puppets(workspace).puppet)
    tool.suggested.wait()
    ends = tool.suggested.suggest_vertices(find_puppets(workspace).puppet)
    assert len(ends) >= 5
    play([Click(Near(OnPuppet("star", ends[0]), 4, -3))], stage)
    assert find_puppets(workspace).puppet.points[0].vertex == ends[0]
    assert ends[0] not in tool.suggested.suggest_vertices(find_puppets(workspace).puppet)


def test_self_intersections_are_reported_except_at_rest(tmp_path) -> None:
    workspace, stage = studio(tmp_path, "head", "left", "right", "foot", "other", take="sway")
    play([Do(lambda d: get_puppet_editor(d.editor).begin_pose("sway", 0.5))], stage)
    find_puppets(workspace).self_intersection.wait()
    assert workspace.input.tool.warning == ""
    places = find_puppets(workspace).puppet.rest.copy()
    places[1] = [0.3, 0.45, 0.0]
    for share in np.linspace(0.1, 1.0, 10):
        find_puppets(workspace).drag(
            1, (1 - share) * find_puppets(workspace).puppet.rest[1] + share * places[1]
        )
        workspace.editor.advance(STEP)
    find_puppets(workspace).drop()
    for _ in range(5):
        workspace.editor.advance(STEP)
        find_puppets(workspace).self_intersection.wait()
    assert "left" in workspace.input.tool.warning and len(find_puppets(workspace).self_intersection.faces) > 2
    play([Key("w"), Key("o")], stage)
    assert (
        workspace.input.tool.warning == ""
        and len(find_puppets(workspace).self_intersection.faces) == 0
        and not find_puppets(workspace).silhouette
    )
    play([Key("w"), Key("o"), Key("enter")], stage)
    assert find_puppets(workspace).warn and find_puppets(workspace).silhouette
    assert workspace.input.tool.warning == "" and len(find_puppets(workspace).self_intersection.faces) == 0


def test_a_puppet_is_moved_turned_copied_and_deleted_as_other_shapes(tmp_path) -> None:
    workspace, stage = studio(tmp_path, "head", take="sway")
    belly = OnPuppet("star", int(np.linalg.norm(star().vertices - [0.0, 0.5, 0.2], axis=1).argmin()))
    play([Key("g"), Drag((belly, Near(belly, 90, 0)))], stage)
    moved = find_puppets(workspace).puppet.place
    assert np.linalg.norm(moved) > 0.1
    play([Key("r"), Drag((belly, Near(belly, 90, 0)))], stage)
    assert (
        abs(find_puppets(workspace).puppet.turn[0]) < 0.999
        and workspace.editor.history.undo_name == "turn star"
    )
    play([Key("ctrl+d"), Key("f")], stage)
    assert (
        list(workspace.editor.project.puppets) == ["star", "star 2"]
        and workspace.editor.selection.character == "star 2"
    )
    play([Key("ctrl+equal"), Key("ctrl+m"), Key("ctrl+left")], stage)
    play([Key("ctrl+c"), Key("ctrl+v"), Key("ctrl+x"), Key("ctrl+v"), Key("delete")], stage)
    assert len(workspace.editor.project.puppets) == 2 and not bad(workspace)
    while workspace.editor.history.undo_name is not None:
        workspace.editor.undo()
    assert (
        list(workspace.editor.project.puppets) == ["star"]
        and not workspace.editor.project.puppets["star"].place.any()
    )


def test_click_selects_a_puppet_and_click_outside_deselects(tmp_path) -> None:
    workspace, stage = studio(tmp_path, "head")
    play([Key("q"), Click(Pixel(0.02, 0.9))], stage)
    assert workspace.editor.selection.character is None
    play([Click(Spot(0.0, 0.5, 0.0))], stage)
    assert workspace.editor.selection.character == "star"


def test_a_puppet_is_made_of_a_shape_which_stays(tmp_path, make_limb) -> None:
    workspace, stage = studio(tmp_path)
    workspace.store.new(workspace.editor.project.drop_character("star").with_characters(make_limb("limb")))
    assert workspace.editor.selection.character is None
    play([Key("f"), Wait(1.0), Click(Spot(0.0, 0.8, 0.05)), Key("ctrl+p")], stage)
    puppet = workspace.editor.project.puppets["limb puppet"]
    assert "limb" in workspace.editor.project.shapes and workspace.editor.selection.character == "limb puppet"
    assert puppet.mesh.vertices[:, 1].min() == 0.0 and puppet.place[1] == pytest.approx(0.2)
    workspace.editor.select(character=None)
    play([Key("ctrl+p")], stage)
    assert "No shape" in workspace.editor.toasts.shown[-1].text


def test_puppet_plays_its_key_poses_and_survives_saving(tmp_path) -> None:
    workspace, _ = studio(tmp_path, "head", "left", "right", "foot", take="sway")
    two_poses(workspace)
    find_puppets(workspace).motion_solver.settle(workspace.editor.project, "star")
    seen = []
    for _ in range(12):
        workspace.editor.playing = True
        workspace.editor.advance(0.1)
        seen.append(find_puppets(workspace).stage_puppets[0].vertices[vertex("head")])
    assert np.ptp(np.array(seen)[:, 0]) > 0.05 and not bad(workspace)
    path = tmp_path / "star.enliven"
    write_project(path, workspace.editor.project)
    assert are_identical(read_project(path).puppets["star"], find_puppets(workspace).puppet)


def test_scrubbing_shows_the_same_whatever_came_before(tmp_path) -> None:
    workspace, _ = studio(tmp_path, "head", "left", "right", "foot", take="sway")
    two_poses(workspace)
    find_puppets(workspace).motion_solver.settle(workspace.editor.project, "star")
    vertices = []
    for before in (0.0, 2.5):
        workspace.editor.scrub(before)
        _ = find_puppets(workspace).stage_puppets
        workspace.editor.scrub(0.8)
        vertices.append(find_puppets(workspace).stage_puppets[0].vertices)
    assert are_alike(vertices[0], vertices[1], SOLVER_TOLERANCE)


def test_large_mesh_is_prepared_in_the_background(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("enliven_viewer.studio.puppets.solver.MIN_ANNOUNCED_VERTICES", 30_000)
    workspace, _ = studio(tmp_path)
    mesh = refine(star(), 0.008)
    assert len(mesh.vertices) > 30_000
    puppet = find_puppets(workspace).puppet.with_changes(mesh=mesh)
    workspace.editor.edit("finer", lambda p: p.with_characters(puppet))
    assert np.array_equal(find_puppets(workspace).stage_puppets[0].surface, mesh.vertices)
    assert "is a very fine mesh: you can drag it in a moment" in workspace.editor.toasts.shown[-1].text
    find_puppets(workspace).add_point(0)
    for _ in range(2000):
        if find_puppets(workspace).stage.surfaces.is_prepared(find_puppets(workspace).puppet):
            break
        sleep(0.01)
    assert "You can drag" in workspace.editor.toasts.shown[-1].text
    find_puppets(workspace).drag(0, mesh.vertices[0] + [0.0, 0.2, 0.0])
    assert np.allclose(
        find_puppets(workspace).stage_puppets[0].surface[0], mesh.vertices[0] + [0.0, 0.2, 0.0]
    )


def test_without_a_puppet_the_tool_does_nothing(tmp_path) -> None:
    workspace, stage = studio(tmp_path)
    workspace.store.new()
    assert "Ctrl+P makes one" in workspace.input.tool.hint
    play([Click(Pixel(0.5, 0.5)), Key("delete"), Key("r"), Key("k"), Key("enter")], stage)
    assert not workspace.editor.project.puppets and not bad(workspace)


@pytest.mark.slow
def test_stroke_cuts_a_puppet_and_both_parts_keep_moving(tmp_path) -> None:
    workspace, stage = studio(tmp_path, "head", "left", "right", "foot", "other", take="sway")
    two_poses(workspace)
    workspace.editor.edit("pair", lambda p: change_point(p, "star", "other", joint="root"))
    workspace.editor.camera.face(0.0, 0.0)
    workspace.editor.camera.advance(10.0)
    stroke = (Spot(-0.25, 0.35), Spot(-0.25, 0.9))
    play([Key("c"), Drag(stroke)], stage)
    assert len(workspace.editor.project.puppets) == 2, [toast.text for toast in workspace.editor.toasts.shown]
    assert not bad(workspace) and workspace.editor.selection.character in workspace.editor.project.puppets
    assert len(find_puppets(workspace).stage_puppets) == 2
    workspace.editor.undo()
    assert list(workspace.editor.project.puppets) == ["star"]


@pytest.mark.slow
def test_a_puppet_dropped_with_shift_on_another_becomes_one_with_it(tmp_path) -> None:
    workspace, stage = studio(tmp_path, "head", "left", "right", "foot", take="sway")
    two_poses(workspace)
    workspace.editor.camera.face(0.0, 0.0)
    workspace.editor.camera.advance(10.0)
    play([Key("ctrl+d"), Key("f"), Key("g")], stage)
    belly = int(np.linalg.norm(star().vertices - [0.0, 0.5, 0.2], axis=1).argmin())
    arm = int(np.linalg.norm(star().vertices - [0.3, 0.57, 0.1], axis=1).argmin())
    play([Drag((OnPuppet("star 2", belly), OnPuppet("star", arm)), shift=True)], stage)
    assert list(workspace.editor.project.puppets) == ["star"], [t.text for t in workspace.editor.toasts.shown]
    assert len(find_puppets(workspace).puppet.points) >= 8 and not bad(workspace)
    workspace.editor.undo()
    assert len(workspace.editor.project.puppets) == 2


@pytest.mark.slow
def test_puppet_is_baked_in_the_background(tmp_path, make_limb) -> None:
    workspace, stage = studio(tmp_path, take="sway")
    mesh = make_limb("post").mesh
    workspace.editor.edit("post", lambda p: play_take(make_puppet(p, mesh, "post"), "post", "sway"))
    for number, joint in ((0, "root"), (len(mesh.vertices) - 1, "bone 3")):
        workspace.editor.edit("put", lambda p, n=number, j=joint: add_point(p, "post", n, j, joint=j))
    workspace.editor.select_only("post")
    rest = find_puppets(workspace).puppet.rest
    for time, way in ((0.0, 0.0), (0.8, 0.3)):
        places = np.add(rest, [[0.0, 0.0, 0.0], [way, 0.0, 0.0]])
        workspace.editor.edit("pose", lambda p, t=time, q=places: add_key_pose(p, "post", "sway", t, q))
    workspace.state(PuppetCommands).bake_puppet()
    assert "Baking" in workspace.editor.toasts.shown[-1].text and "post" in workspace.editor.project.puppets
    workspace.editor.background.finish()
    assert (
        workspace.editor.selection.character == "post"
        and "post" not in workspace.editor.project.puppets
        and not bad(workspace)
    )
    play([Key("ctrl+z")], stage)
    workspace.editor.select_only("post")
    workspace.state(PuppetCommands).bake_puppet()
    find_puppets(workspace).add_point(20)
    workspace.editor.background.finish()
    assert "post" in workspace.editor.project.puppets and "changed during the baking" in bad(workspace)[-1]


def test_puppet_without_motion_cannot_be_baked(tmp_path) -> None:
    workspace, _ = studio(tmp_path, "head", take="sway")
    workspace.state(PuppetCommands).bake_puppet()
    workspace.editor.background.finish()
    assert bad(workspace) and "star" in workspace.editor.project.puppets
