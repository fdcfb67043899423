"""Tests of the selection's curves for every rig: curves equal the playback, and each drag is one edit."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[2] / "shared" / "modeling"))
from test_character_laws import WORLDS

from enliven.document import KEY_STEP, MIN_SPEED, Layer, are_identical
from enliven.modeling.edits import (
    change_layers,
    compute_vertices,
    find_keys,
    get_rig_edits,
    layer_keys,
    set_key,
)
from enliven.rotation import from_rotation_vector, to_matrix
from enliven_viewer.studio.app.time_axis import TimeAxis
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.animation.curve_input import CurveInput
from enliven_viewer.studio.features.animation.curve_scale import Scale
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.viewport.overlay import Disc
from enliven_viewer.studio.workspace.key_commands import KeyCommands

rigs = pytest.mark.parametrize("rig", ["bones", "graph", "points", "cage"])
BONE = 2


def desk(rig: str, handle: int | None = BONE, keyed: bool = False) -> tuple[Editor, CurveInput, str]:
    project, name = WORLDS[rig]
    if keyed:
        for frame, degrees in ((0, (0, 0, 0)), (15, (0, 40, -10)), (45, (5, -30, 20))):
            project = set_key(project, name, BONE, frame * KEY_STEP, degrees)
    editor = Editor(project=project)
    if rig == "points":
        get_puppet_editor(editor).motion_solver.settle(project, name)
    editor.select_only(name, handle if rig != "graph" else None)
    curves = CurveInput(editor, TimeAxis(editor))
    curves.toggle()
    return editor, curves, name


@rigs
def test_places_and_turns_are_those_that_are_played(rig: str) -> None:
    editor, curves, name = desk(rig)
    groups = curves.settle()
    character = editor.project.characters[name]
    player = get_rig_edits(character).create_player(editor.project, character)
    for k in (0, 57, 120, 239):
        pose, handles = player(float(curves.times[k]))
        linear, place = np.asarray(pose.linear, float), groups["place"].values[k]
        seen = from_rotation_vector(np.radians(groups["turn"].values[k]))
        if rig == "graph":
            np.testing.assert_allclose(place, pose.positions.mean(0), atol=1e-5)
        elif rig == "points":
            np.testing.assert_allclose(linear[0] @ place + pose.positions[0], handles[BONE], atol=1e-5)
        else:
            np.testing.assert_allclose(place, handles[BONE], atol=1e-5)
        if rig == "bones":
            above = linear[character.parents[BONE]]
            np.testing.assert_allclose(above @ to_matrix(seen), linear[BONE], atol=1e-5)
    jumps = np.abs(np.diff(groups["turn"].values, axis=0)).max()
    assert jumps < 60.0, "no jump of a whole round"


@settings(deadline=None, max_examples=25)
@given(st.floats(-2, 2).filter(lambda v: abs(v) > 0.05), st.floats(0, 1), st.floats(0, 1))
def test_weight_and_speed_are_those_of_the_layer(speed: float, weight: float, offset: float) -> None:
    project, name = WORLDS["bones"]
    how = {"offset": offset, "speed": speed, "weight": weight, "loop": False, "segments": ()}
    project = change_layers(project, name, [0], **how)
    editor = Editor(project=project)
    editor.select_only(name)
    editor.select(layer=0)
    curves = CurveInput(editor, TimeAxis(editor))
    groups, layer = curves.settle(), project.characters[name].playing[0]
    assert np.unique(groups["weight"].values).tolist() == pytest.approx([weight])
    begin, end = offset, layer.end(project.length_of(layer))
    inside = (curves.times > begin + 1e-3) & (curves.times < end - 1e-3)
    np.testing.assert_allclose(groups["speed"].values[inside, 0], speed, rtol=1e-6)
    assert (groups["speed"].values[(curves.times < begin - 1e-3) | (curves.times > end + 1e-3)] == 0).all()


def at(curves: CurveInput, number: int, axis: int) -> tuple[float, float]:
    group = curves.find_shown_group()
    assert group is not None
    dot = next(each for each in group.dots if (each.number, each.axis) == (number, axis))
    return curves.axis.scale.x(dot.time), curves.scale(group).y(dot.value)


def test_a_key_is_dragged_in_value_and_in_time_each_as_one_edit() -> None:
    editor, curves, name = desk("bones", keyed=True)
    before = editor.project
    x, y = at(curves, 1, 1)
    scale = curves.scale(curves.find_shown_group())
    up = scale.height * 10.0 / (scale.high - scale.low)
    curves.press(x, y)
    for share in (0.5, 1.0):
        curves.drag(x, y - share * up)
        assert editor.draft is not None and editor.history.names == (), "a draft until it is let go"
    curves.release(x, y - up)
    assert editor.history.names == ("move key",) and not curves.busy
    (_, first), (time, key), (_, last) = find_keys(editor.project, name, BONE)
    assert key.degrees == pytest.approx((0, 50, -10)) and time == pytest.approx(15 * KEY_STEP)
    assert first.degrees == (0, 0, 0) and last.degrees == (5, -30, 20), "the others stay"
    editor.undo()
    assert are_identical(editor.project, before)
    x, y = at(curves, 1, 1)
    along = curves.axis.scale.x(10 * KEY_STEP) - curves.axis.scale.x(0.0)
    curves.press(x, y)
    curves.drag(x + along, y)
    curves.release(x + along, y)
    _, (time, key), _ = find_keys(editor.project, name, BONE)
    assert time == pytest.approx(25 * KEY_STEP) and key.degrees == (0, 40, -10)
    curves.press(x + along, y)
    curves.release(x + along, y)
    assert len(editor.history.names) == 1, "a click is no edit"


def test_keys_are_added_by_a_double_click_eased_and_removed() -> None:
    editor, curves, name = desk("bones", keyed=True)
    group = curves.find_shown_group()
    assert group is not None and group.name == "keys"
    x, y = curves.axis.scale.x(30 * KEY_STEP), curves.scale(group).y(33.0)
    curves.double_click(x, y)
    keys = find_keys(editor.project, name, BONE)
    assert len(keys) == 4 and 33.0 in [pytest.approx(value, abs=0.01) for value in keys[2][1].degrees]
    curves.press(*at(curves, 2, 0))
    curves.release(*at(curves, 2, 0))
    curves.set_interpolation("step")
    assert find_keys(editor.project, name, BONE)[2][1].ease == "step"
    assert curves.handle_key("delete") and not curves.handle_key("delete"), (
        "the node stays where no key is chosen"
    )
    assert len(find_keys(editor.project, name, BONE)) == 3
    assert editor.history.names == ("set key", "step key", "remove key")


def test_a_bone_without_keys_gets_its_first_by_a_double_click() -> None:
    editor, curves, name = desk("bones")
    group = curves.find_shown_group()
    assert group is not None and not group.dots
    curves.double_click(curves.axis.scale.x(0.5), curves.scale(group).y(3.0))
    ((time, key),) = find_keys(editor.project, name, BONE)
    assert time == pytest.approx(0.5) and max(key.degrees) == pytest.approx(3.0)
    assert isinstance(editor.project.characters[name].playing[-1], Layer)


def test_a_control_points_key_pose_is_dragged_on_its_curve() -> None:
    editor, curves, name = desk("points")
    curves.group = "place"
    curves.settle()
    group = curves.find_shown_group()
    assert group is not None and group.name == "place" and group.dots
    dot = group.dots[1]
    before = editor.project.puppet(name).poses[dot.number].places
    x, y = curves.axis.scale.x(dot.time), curves.scale(group).y(dot.value)
    curves.press(x, y)
    held = curves._held_key[0]
    curves.drag(x, y - 20)
    curves.release(x, y - 20)
    after = editor.project.puppet(name).poses[held.number].places
    changed = np.argwhere(after != before)
    assert changed.tolist() == [[BONE, held.axis]] and editor.history.names == ("move key",)


@settings(deadline=None, max_examples=60)
@given(st.floats(-100, 100), st.floats(0.01, 300), st.floats(0, 160), st.floats(-5, 5), st.floats(-200, 200))
def test_a_scale_keeps_what_is_under_the_pointer(low, wide, y, notches, pixels) -> None:
    scale = Scale(low, low + wide, 160.0)
    assert scale.y(scale.value(y)) == pytest.approx(y, abs=1e-6)
    zoomed = scale.zoom(0.85**notches, y)
    assert zoomed.value(y) == pytest.approx(scale.value(y), abs=1e-6 * (1 + wide))
    assert scale.pan(pixels).y(scale.value(y)) == pytest.approx(y + pixels, abs=1e-5)
    ticks = scale.ticks()
    assert all(low - 1e-6 <= tick <= low + wide + 1e-6 for tick in ticks) and 1 <= len(ticks) <= 8
    steps = np.diff(ticks)
    assert not len(steps) or np.ptp(steps) < 1e-6 * wide
    assert replace(scale, height=80.0).y(low) == pytest.approx(80.0)


def test_posing_sets_keys_while_that_is_on() -> None:
    from enliven_viewer.studio.tools.base import Pointer
    from enliven_viewer.studio.tools.pose import PoseTool

    editor, _, name = desk("bones")
    editor.size = (800.0, 600.0)
    editor.frame_all(at_once=True)
    editor.time, editor.is_auto_key = 0.7, True
    modeled = editor.project.shape(name).modeling
    tool = PoseTool(editor)
    start = editor.lens.project_visible(editor.stage_character(name).handles[[BONE]])[0]
    assert tool.press(Pointer(start))
    tool.drag(Pointer((start[0] + 40, start[1] + 30)))
    tool.release(Pointer((start[0] + 40, start[1] + 30)))
    assert editor.history.names == (f"key {name}",)
    ((time, key),) = find_keys(editor.project, name, BONE)
    assert time == pytest.approx(0.7, abs=KEY_STEP) and np.abs(key.degrees).max() > 1.0
    assert np.array_equal(editor.project.shape(name).modeling, modeled), "its pose at all moments stays"


@settings(deadline=None, max_examples=40)
@given(st.floats(0.0, 4.0) | st.integers(0, 200).map(lambda half: half / 60))
def test_a_key_that_is_set_at_the_playhead_is_removed_there(time: float) -> None:
    editor, _, name = desk("bones")
    commands, before = KeyCommands(editor), editor.project
    editor.time = time
    assert commands.describe_missing_key() and not commands.describe_missing()
    commands.set()
    assert len(find_keys(editor.project, name, BONE)) == 1 and not commands.describe_missing_key()
    commands.remove()
    assert are_identical(editor.project, before)


def drag(tool, start, way) -> None:
    from enliven_viewer.studio.tools.base import Pointer

    end = (start[0] + way[0], start[1] + way[1])
    assert tool.press(Pointer(start))
    tool.drag(Pointer(end))
    tool.release(Pointer(end))


@rigs
def test_a_character_is_moved_over_the_stage_by_keys_while_that_is_on(rig: str) -> None:
    from enliven_viewer.studio.tools.move import MoveTool

    editor, curves, name = desk(rig, handle=None)
    editor.size = (800.0, 600.0)
    editor.frame_all(at_once=True)
    KeyCommands(editor).set()  # at 0 s, the key changes nothing
    editor.time, editor.is_auto_key = 1.0, True
    before = compute_vertices(editor.project, name, 1.0)
    x, y = editor.lens.project_visible(before.mean(0)[None])[0]
    drag(MoveTool(editor), (x, y), (90, -20))
    assert editor.history.names == ("set key", f"move {name}")
    (_, still), (time, key) = find_keys(editor.project, name, None)
    assert time == pytest.approx(1.0) and not any(still.metres) and np.abs(key.metres).max() > 0.05
    after, start = compute_vertices(editor.project, name, 1.0), compute_vertices(editor.project, name, 0.0)
    np.testing.assert_allclose(after - before, np.broadcast_to(key.metres, after.shape), atol=1e-6)
    np.testing.assert_allclose(start, compute_vertices(WORLDS[rig][0], name, 0.0), atol=1e-6)
    if rig == "points":
        get_puppet_editor(editor).motion_solver.settle(editor.project, name)
    seen = editor.stage_character(name).vertices  # a puppet's surface is solved in the background
    if rig != "points":
        np.testing.assert_allclose(seen, after, atol=1e-5)
    handles = (
        get_rig_edits(editor.find_selected())
        .create_player(editor.project, editor.find_selected())(1.0)
        .handles
    )
    np.testing.assert_allclose(editor.stage_character(name).handles, handles, atol=1e-6)
    curves.group = "moves"
    group = curves.find_shown_group()
    assert group is not None and group.name == "moves"
    x, y = at(curves, 1, 0)
    curves.press(x, y)
    curves.drag(x, y - 30)
    curves.release(x, y - 30)
    assert find_keys(editor.project, name, None)[1][1].metres[0] > key.metres[0]
    assert editor.history.names[-1] == "move key"


@pytest.mark.slow
@rigs
def test_weight_and_speed_have_keys_on_their_curves(rig: str) -> None:
    editor, curves, name = desk(rig, handle=None)
    editor.select(layer=0)
    curves.settle()
    for group, number in (("weight", "weights"), ("speed", "speeds")):
        curves.group = group
        shown = curves.find_shown_group()
        assert shown is not None and shown.name == group and not shown.dots
        for second, value in ((0.3, 0.8), (0.9, 0.5)):
            curves.double_click(curves.axis.scale.x(second), curves.scale(shown).y(value))
        shown = curves.settle()[group]
        assert [dot.time for dot in shown.dots] == pytest.approx([0.3, 0.9], abs=0.02)
        drawn = np.interp([dot.time for dot in shown.dots], curves.times, shown.values[:, 0])
        np.testing.assert_allclose([dot.value for dot in shown.dots], drawn, atol=0.05)
        x, y = at(curves, 1, 0)
        curves.press(x, y)
        curves.drag(x, y + 5000)
        curves.release(x, y + 5000)  # below the minimum, the minimum is used and reported
        keys = layer_keys(editor.project, name, 0, number)
        assert keys[1].value == (0.0 if number == "weights" else MIN_SPEED)
        assert editor.toasts.shown
        curves.press(*at(curves, 0, 0))
        curves.release(*at(curves, 0, 0))
        curves.set_interpolation("linear")
        assert layer_keys(editor.project, name, 0, number)[0].ease == "linear"
        curves.remove()
        assert len(layer_keys(editor.project, name, 0, number)) == 1
        while editor.history.undo_name:
            editor.undo()
        assert are_identical(editor.project, WORLDS[rig][0])
        curves.settle()


def test_a_dragged_dot_of_a_possessed_mesh_sets_a_key_that_bends_it_there() -> None:
    from enliven_viewer.studio.tools.pose import PoseTool

    editor, curves, name = desk("graph")
    editor.size = (800.0, 600.0)
    editor.frame_all(at_once=True)
    editor.time, tool = 0.6, PoseTool(editor)
    assert not any(isinstance(mark, Disc) for mark in tool.overlay().marks), "no dots before it sets keys"
    editor.is_auto_key = True
    assert len(tool.overlay().marks) == len(editor.project.graph(name).positions)
    nodes = np.array(editor.stage_character(name).nodes, float)
    pixels = np.array(editor.lens.project_visible(nodes))
    distances = np.linalg.norm(pixels[:, None] - pixels[None], axis=2) + 1e9 * np.eye(len(pixels))
    node = int(distances.min(1).argmax())  # the node that is farthest from the others in the image
    drag(tool, tuple(pixels[node]), (0, -40))
    assert editor.selection.handle == node and editor.history.names == (f"key {name}",)
    ((time, key),) = find_keys(editor.project, name, node)
    assert time == pytest.approx(0.6, abs=KEY_STEP) and np.abs(key.metres).max() > 0.01
    moved = np.array(editor.stage_character(name).nodes, float)
    (pixel,) = editor.lens.project_visible(moved[[node]])
    np.testing.assert_allclose(pixel, pixels[node] + (0, -40), atol=0.5)
    assert {"keys", "moves"} <= set(curves.groups()) and len(curves.groups()["moves"].dots) == 3
    commands = KeyCommands(editor)
    assert not commands.describe_missing_key()
    commands.remove()
    assert are_identical(editor.project, WORLDS["graph"][0])
