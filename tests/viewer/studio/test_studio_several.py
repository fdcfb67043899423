"""Tests of multiple selection by clicks and boxes. Each action is one edit of all selected characters."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_acting_stage import acting_stage, pixel_on

from enliven.document.project import are_identical
from enliven.modeling.edits import (
    compute_vertices,
    copy_characters,
    group_centre,
    mirror_character,
    mirror_characters,
    scale_character,
    scale_characters,
    shift_characters,
    turn_character,
    turn_characters,
)
from enliven.rotation import from_rotation_vector, rotate
from enliven_viewer.studio.features.outliner.outliner import Outliner
from enliven_viewer.studio.viewport.selection import Selection
from enliven_viewer.studio.workspace.workspace import Workspace

PAIR = ("limb", "post")


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    opened = acting_stage(tmp_path)
    opened.editor.frame_all(at_once=True)
    return opened


@pytest.fixture(scope="module", autouse=True)
def _made(tmp_path_factory) -> None:
    global PROJECT
    PROJECT = acting_stage(tmp_path_factory.mktemp("several")).editor.project


def seen(project, name: str, time: float = 0.4) -> np.ndarray:
    return compute_vertices(project, name, time)


numbers = st.floats(-2.0, 2.0)


@pytest.mark.slow
@settings(max_examples=20)
@given(st.floats(0.2, 4.0), st.tuples(numbers, numbers, numbers), st.integers(0, 2))
def test_several_are_changed_as_if_they_were_one_body(factor, axis, side) -> None:
    middle, turn = group_centre(PROJECT, PAIR), from_rotation_vector(np.array(axis))
    floor, normal = middle * [1.0, 0.0, 1.0], np.eye(3)[side]
    for change, moved in (
        (lambda p, n: scale_characters(p, n, factor), lambda x: floor + factor * (x - floor)),
        (lambda p, n: turn_characters(p, n, turn), lambda x: middle + rotate(turn, x - middle)),
        (
            lambda p, n: mirror_characters(p, n, normal),
            lambda x: x - 2.0 * np.outer((x - middle) @ normal, normal),
        ),
    ):
        after = change(PROJECT, PAIR)
        for name in PAIR:
            got, wanted = seen(after, name), moved(seen(PROJECT, name))
            assert np.abs(np.sort(got, 0) - np.sort(wanted, 0)).max() < 1e-6 * (1 + np.abs(wanted).max())
        assert after.characters["star"] is PROJECT.characters["star"]


@settings(max_examples=15)
@given(st.sampled_from(["limb", "post", "star"]), st.floats(0.2, 4.0))
def test_edits_of_several_equal_single_edits_for_one_character(name, factor) -> None:
    turn = from_rotation_vector(np.array([0.1, factor, 0.3]))
    assert are_identical(scale_characters(PROJECT, [name], factor), scale_character(PROJECT, name, factor))
    assert are_identical(turn_characters(PROJECT, [name], turn), turn_character(PROJECT, name, turn))
    if name != "star":  # its surface would have to be solved
        single = mirror_character(PROJECT, name, np.eye(3)[0])
        several = mirror_characters(PROJECT, [name], np.eye(3)[0])
        assert np.allclose(seen(single, name), seen(several, name), atol=1e-9)


def test_copies_keep_their_distances_and_shifts_their_order() -> None:
    after, copies = copy_characters(PROJECT, PROJECT, PAIR, np.array([2.0, 0.0, 0.0]))
    assert copies == ("limb 2", "post 2")
    for name, copy in zip(PAIR, copies, strict=True):
        assert np.allclose(seen(after, copy), np.add(seen(after, name), [2.0, 0.0, 0.0]), atol=1e-6)
    later = shift_characters(PROJECT, PAIR, 0.25)
    assert np.allclose(seen(later, "limb", 0.65), seen(PROJECT, "limb", 0.4), atol=1e-9)


IDS = st.sampled_from(["star", "limb", "post"])


@given(st.lists(st.one_of(IDS, st.tuples(IDS))))
def test_click_selects_one_and_ctrl_toggles(clicks) -> None:
    selection, expected = Selection(), []
    for click in clicks:
        if isinstance(click, tuple):
            chosen = selection.characters
            rest = [name for name in chosen if name != click[0]]
            selection = Selection.from_ids(*(rest if click[0] in chosen else (*chosen, click[0])))
            expected = [name for name in expected if name != click[0]] + [click[0]] * (
                click[0] not in expected
            )
        else:
            selection, expected = Selection(click), [click]
        assert list(selection.characters) == expected and selection.has_several == (len(expected) > 1)
        assert selection.restricted_to(PROJECT) == selection
    assert set(selection.with_active("limb").characters) == set(expected if "limb" in expected else ["limb"])


def click(workspace: Workspace, at: tuple[float, float], **held: bool) -> None:
    workspace.input.move(at, **held)
    workspace.input.press(at, **held)
    workspace.input.release(at, **held)


def test_clicks_and_boxes_in_the_view_choose_several(workspace) -> None:
    editor = workspace.editor
    click(workspace, pixel_on(workspace, "star"))
    click(workspace, pixel_on(workspace, "post"), ctrl=True)
    assert editor.selection.characters == ("star", "post")
    click(workspace, pixel_on(workspace, "limb"), shift=True)
    assert editor.selection.characters == ("star", "post", "limb")
    click(workspace, pixel_on(workspace, "post"), ctrl=True)
    assert editor.selection.characters == ("star", "limb")
    click(workspace, pixel_on(workspace, "post"))
    assert editor.selection.characters == ("post",)
    (wide, high), view = editor.size, editor.lens.view.eye
    workspace.input.press((1.0, 1.0), ctrl=True)
    workspace.input.move((wide - 1.0, high - 1.0), ctrl=True)
    assert len(workspace.input.tool.overlay().marks) == 2
    workspace.input.release((wide - 1.0, high - 1.0), ctrl=True)
    assert set(editor.selection.characters) == {"star", "limb", "post"}
    assert np.array_equal(editor.lens.view.eye, view), "the box does not turn the view"
    workspace.actions.do("edit.none")
    assert editor.selection.characters == ()
    workspace.state(Outliner).set_locked("post", is_locked=True)
    workspace.actions.do("edit.all")
    assert editor.selection.characters == ("star", "limb")
    editor.select_only("star")
    workspace.actions.do("edit.inverse")
    assert editor.selection.characters == ("limb",)


def test_each_action_on_several_characters_is_one_undo_step(workspace) -> None:
    editor, first = workspace.editor, workspace.editor.project
    for deed in (
        *("edit.delete", "edit.duplicate", "edit.cut_out", "shape.mirror", "shape.larger"),
        *("shape.turn_left", "motion.later", "motion.mute", "shape.hide", "shape.lock"),
    ):
        editor.choose_all(*PAIR)
        steps = len(editor.history.names)
        assert workspace.actions.do(deed), deed
        assert len(editor.history.names) == steps + 1, deed
        changed = [n for n in PAIR if editor.project.characters.get(n) is not first.characters[n]]
        handled = [n for n in PAIR if n in editor.project.handling]
        if deed == "edit.duplicate":
            assert len(editor.project.characters) == 5 and editor.selection.has_several
        else:
            assert list(PAIR) in (changed, handled), deed
        editor.undo()
        assert are_identical(editor.project, first), deed


def test_drag_moves_all_selected_characters(workspace) -> None:
    editor = workspace.editor
    editor.choose_all("limb", "post")
    workspace.input.activate_tool("carry")
    before = {name: seen(editor.project, name) for name in PAIR}
    at = pixel_on(workspace, "post")
    workspace.input.press(at)
    workspace.input.move((at[0] + 60.0, at[1]))
    workspace.input.release((at[0] + 60.0, at[1]))
    ways = {name: seen(editor.project, name) - before[name] for name in PAIR}
    assert np.allclose(ways["limb"][0], ways["post"][0], atol=1e-6) and np.linalg.norm(ways["post"][0]) > 0.05
    assert editor.history.names[-1] == "move 2 shapes" and editor.selection.has_several


def test_single_shape_actions_refuse_multiple_selection(workspace) -> None:
    editor = workspace.editor
    editor.choose_all("post", "limb")
    for deed in ("shape.puppet", "motion.clear", "view.best", "shape.up"):
        assert "Several" in workspace.actions[deed].why_not(), deed
    editor.select_only("limb")
    assert workspace.actions["motion.clear"].why_not() == ""
