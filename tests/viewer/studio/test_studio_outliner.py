"""Tests of the outliner (its tree and filter, names, order, visibility and locks), and of multiple
selection.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from in_a_window import in_a_window
from made_acting_stage import acting_stage
from studio_driver import Click, Drag, HeadlessStage, JointPlace, Key, play

from enliven.document.project import FREE, are_identical
from enliven.errors import InputError
from enliven.formats.project.file import read_project, write_project
from enliven.modeling.edits import (
    delete_take,
    handle_characters,
    move_character,
    order_characters,
    refuse_locked,
    rename_character,
    rename_take,
    scale_character,
)
from enliven_viewer.studio.features.outliner.outliner import Outliner
from enliven_viewer.studio.workspace.files import list_exportable
from enliven_viewer.studio.workspace.workspace import Workspace

SESSION = Path(__file__).parents[1] / "studio_outliner_session.py"
FULL = acting_stage  # a waving limb, a possessed post, and the puppet of a star


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    return FULL(tmp_path)


def labels(outliner: Outliner) -> list[tuple[int, str]]:
    return [(row.depth, row.label) for row in outliner.rows]


def row(outliner: Outliner, key: str):
    return next(entry for entry in outliner.rows if entry.key == key)


def test_the_tree_has_characters_with_what_is_below_them_and_takes(workspace) -> None:
    outliner = workspace.state(Outliner)
    assert labels(outliner)[:4] == [(0, "Shapes"), (1, "star"), (1, "limb"), (1, "post")]
    assert (0, "Takes") in labels(outliner) and (1, "wave") in labels(outliner)
    outliner.toggle_folded(row(outliner, "character limb"))
    joints = workspace.editor.project.shape("limb").skeleton.names
    below = [entry for entry in outliner.rows if entry.id == "limb" and entry.kind == "handle"]
    assert sorted(entry.label for entry in below) == sorted(joints) and below[0].note == "root"
    outliner.toggle_folded(row(outliner, "group shapes"))
    assert labels(outliner)[:2] == [(0, "Shapes"), (0, "Takes")]


def test_the_filter_shows_what_has_the_letters_with_what_it_is_below(workspace) -> None:
    outliner = workspace.state(Outliner)
    outliner.typed = "LEF"
    assert labels(outliner) == [(0, "Shapes"), (1, "star"), (2, "left")], "folded rows are found too"
    outliner.typed = "no such thing"
    assert outliner.rows == ()


def test_clicks_choose_one_a_range_or_one_more(workspace) -> None:
    outliner, editor = workspace.state(Outliner), workspace.editor
    outliner.click(row(outliner, "character star"))
    outliner.click(row(outliner, "character post"), shift=True)
    assert editor.selection.characters == ("star", "limb", "post")
    outliner.click(row(outliner, "character limb"), ctrl=True)
    assert editor.selection.characters == ("star", "post")
    outliner.click(row(outliner, "character limb"), ctrl=True)
    assert editor.selection.characters == ("star", "post", "limb") and editor.find_selected().id == "limb"
    outliner.toggle_folded(row(outliner, "character limb"))
    outliner.click(row(outliner, "handle limb 1"))
    assert editor.selection.characters == ("limb",) and editor.selection.handle == 1
    assert outliner.is_chosen(row(outliner, "handle limb 1"))


def test_hidden_character_is_not_picked_or_framed_but_exported(workspace) -> None:
    editor, before = workspace.editor, len(list_exportable(workspace.editor.project))
    wide = np.ptp(np.array(editor.measure_bounds()), axis=0)[0]
    workspace.state(Outliner).set_hidden("post", is_hidden=True)
    assert (
        "post" not in [posed.id for posed in editor.visible_characters]
        and len(list_exportable(editor.project)) == before
    )
    assert np.ptp(np.array(editor.measure_bounds()), axis=0)[0] < wide
    workspace.actions.do("shape.show_all")
    assert len(editor.visible_characters) == 3 and editor.history.names[-1] == "show post"
    editor.select_only("star")
    workspace.actions.do("shape.hide_others")
    assert [posed.id for posed in editor.visible_characters] == ["star"]
    editor.undo()
    assert len(editor.visible_characters) == 3, "an eye is undone as every edit"


def test_locked_character_is_not_picked_and_refuses_edits(workspace) -> None:
    editor, stage = workspace.editor, HeadlessStage(workspace)
    joint = JointPlace("limb", 1)
    play([Click(joint)], stage)
    assert editor.selection.character == "limb"
    workspace.state(Outliner).set_locked("limb", is_locked=True)
    editor.select_only(None)
    before = editor.project
    play([Click(joint), Key("g"), Drag((joint, JointPlace("limb", 2)))], stage)
    assert editor.selection.character is None and editor.project is before
    for change in (
        lambda project: move_character(project, "limb", [1.0, 0.0, 0.0]),
        lambda project: rename_character(project, "limb", "arm"),
        lambda project: project.drop_character("limb"),
    ):
        assert not editor.edit("change", change) and editor.project is before
    assert "locked" in editor.toasts.shown[-1].text and "lock" in editor.toasts.shown[-1].remedy
    assert editor.edit("move", lambda project: move_character(project, "star", [1.0, 0.0, 0.0]))
    assert editor.edit("record", lambda project: scale_character(project, "limb", 2.0), over_locks=True)
    workspace.actions.do("shape.unlock_all")
    assert editor.edit("move", lambda project: move_character(project, "limb", [1.0, 0.0, 0.0]))


NAMES = st.sampled_from(["star", "limb", "post"])


@pytest.mark.slow
@settings(max_examples=25)
@given(st.lists(st.tuples(NAMES, st.sampled_from([None, True, False]), st.sampled_from([None, True, False]))))
def test_visibility_and_locks_keep_their_last_setting_and_are_saved(steps) -> None:
    project = PROJECT
    expected = {name: [False, False] for name in project.characters}
    for name, hidden, locked in steps:
        project = handle_characters(project, [name], hidden=hidden, locked=locked)
        expected[name] = [
            old if new is None else new for old, new in zip(expected[name], (hidden, locked), strict=True)
        ]
    for name, (hidden, locked) in expected.items():
        flags = project.handling.get(name, FREE)
        assert (flags.hidden, flags.locked) == (hidden, locked)
        moved = move_character(project, name, [0.1, 0.0, 0.0])
        if locked:
            with pytest.raises(InputError, match="locked"):
                refuse_locked(project, moved)
        else:
            refuse_locked(project, moved)
    write_project(FILE, project)
    assert are_identical(read_project(FILE).handling, project.handling)


@settings(max_examples=25)
@given(NAMES, st.integers(-2, 5))
def test_a_character_goes_to_its_place_in_the_list_and_the_others_keep_their_order(name, place) -> None:
    names = list(order_characters(PROJECT, name, place).characters)
    rest = [other for other in PROJECT.characters if other != name]
    assert names.index(name) == min(max(place, 0), 2) and [other for other in names if other != name] == rest


def test_renaming_changes_only_the_name(workspace) -> None:
    outliner, editor = workspace.state(Outliner), workspace.editor
    outliner.set_hidden("limb", is_hidden=True)
    outliner.begin_rename(row(outliner, "character limb"))
    outliner.draft = " arm "
    outliner.end_rename(row(outliner, "character limb"), keep=True)
    assert list(editor.project.characters) == ["star", "arm", "post"], "it keeps its place"
    assert editor.project.handling["arm"].hidden
    outliner.begin_rename(row(outliner, "take wave"))
    outliner.draft = "hello"
    outliner.end_rename(row(outliner, "take wave"), keep=True)
    assert [layer.take for layer in editor.project.shape("arm").layers] == ["hello"]
    outliner.begin_rename(row(outliner, "take hello"))
    outliner.draft = "sway"
    outliner.end_rename(row(outliner, "take hello"), keep=True)
    assert "hello" in editor.project.takes and editor.toasts.shown[-1].is_error, "the name is another's"
    with pytest.raises(InputError, match="arm plays this take"):
        delete_take(editor.project, "hello")
    assert "curl" not in delete_take(editor.project, "curl").takes
    assert set(rename_take(editor.project, "sway", "swing").takes) >= {"swing", "hello"}


@pytest.mark.slow
def test_outliner_works_in_the_window(tmp_path) -> None:
    report = in_a_window(SESSION, str(tmp_path))
    assert report["done"] and report["complaints"] == []
    assert report["several"] == ["star", "limb"] and report["hidden"] == ["limb", "star"], (
        "an eye is all the chosen's"
    )
    assert report["locked"] == ["post"] and report["renamed"] == "wing" and report["order"][-1] == "star"
    assert report["darker"] > 1.0, "what is hidden is not drawn"


@pytest.fixture(scope="module", autouse=True)
def _made(tmp_path_factory) -> None:
    global PROJECT, FILE
    folder = tmp_path_factory.mktemp("outliner")
    PROJECT, FILE = FULL(folder).editor.project, folder / "handled.enliven"
