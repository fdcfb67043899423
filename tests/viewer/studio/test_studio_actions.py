"""Tests of actions: found by letters, done by menu and key in the real window, reassigned to other keys, and
undone.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from in_a_window import in_a_window
from made_acting_stage import CHAIN, LIMB, POST, STAR, TIP, acting_stage

from enliven.document.project import are_identical
from enliven.errors import InputError
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.actions.keys import format_key
from enliven_viewer.studio.actions.palette_search import PaletteSearch
from enliven_viewer.studio.actions.search import score_match
from enliven_viewer.studio.actions.table import ActionTable
from enliven_viewer.studio.preferences import Preferences
from enliven_viewer.studio.toasts import Toasts
from enliven_viewer.studio.workspace.workspace import Workspace

SESSION = Path(__file__).parents[1] / "studio_actions_session.py"


@pytest.mark.slow
def test_every_action_is_done_from_its_menu_and_by_its_key(tmp_path) -> None:
    report = in_a_window(SESSION, str(tmp_path))
    assert report["done"] and report["refused"] == {} and report["complaints"] == []
    assert report["menu"] == [name for name, _ in report["all"]]
    assert report["keys"] == [name for name, has_key in report["all"] if has_key]
    assert report["found"][0] == "tool.puppet" and report["palette does"] == "puppet"
    assert report["stays open"] == "palette", "what cannot be done stays to be read"
    assert report["palette"] == ["", False]
    assert report["free key"] == [["j"], ""]
    assert report["asked"] == ["f", ["j"]], "a key of another action is asked about"
    assert report["taken"] == [["f"], []] and report["by the new key"] is False
    assert report["freed"] == [], "a button in sight takes a key away"
    assert report["went to"] == [2, True]


@pytest.fixture(scope="module")
def stage(tmp_path_factory) -> Workspace:
    return acting_stage(tmp_path_factory.mktemp("actions"))


CHOSEN = (LIMB, TIP, CHAIN, POST, STAR)
AT_RANDOM = int(os.environ.get("ENLIVEN_ACTIONS", "150"))
"""Number of random actions in the session, so that each of about ninety occurs once or twice. `make
test-long` does 500.
"""
_STEPS = ("edit.undo", "edit.redo", "edit.history")
NOT_AT_RANDOM = (*_STEPS, "file.", "shape.bake", "help.", "tool.", "perform.", "scan.")
"""Actions that are not drawn randomly: dialogs, history steps, and actions that take seconds in a thread."""


@pytest.mark.slow
def test_actions_at_random_are_undone_bit_for_bit(stage: Workspace) -> None:
    import random

    chance, editor = random.Random(20), stage.editor
    names = [action.id for action in stage.actions if not action.id.startswith(NOT_AT_RANDOM)]
    first, done = editor.project, 0
    for _ in range(AT_RANDOM):
        wish = dict(chance.choice(CHOSEN))
        wish["character"] = chance.choice([wish["character"], *editor.project.characters])
        character = editor.project.characters.get(str(wish["character"]))
        if character is None or len(character.handles) < 3:
            wish |= {"handle": None, "chain": ()}
        editor.select(**wish)
        name = chance.choice(names)
        if name == "edit.delete" and len(editor.project.characters) < 3:
            name = "edit.duplicate"
        done += stage.actions.do(name)
        assert not any("enliven has an internal error" in toast.text for toast in editor.toasts.shown), name
        if chance.random() < 0.1:
            stage.actions.do(chance.choice(["edit.undo", "edit.redo"]))
    assert done > AT_RANDOM // 2 and editor.history.current_step > AT_RANDOM // 8
    last, at = editor.project, editor.history.current_step
    while editor.history.undo_name:
        stage.actions.do("edit.undo")
    assert are_identical(editor.project, first)
    while editor.history.current_step < at:
        stage.actions.do("edit.redo")
    assert are_identical(editor.project, last)
    editor.go_to(0)
    assert are_identical(editor.project, first)


def test_impossible_action_gives_a_reason_and_changes_nothing(stage: Workspace) -> None:
    stage.editor.select(character=None)
    before = stage.editor.project
    for action in stage.actions:
        reason = action.why_not()
        if reason:
            assert not stage.actions.do(action.id), action.id
            assert stage.editor.toasts.shown[-1].text in reason
            assert reason in stage.actions.make_tooltip(action)
    assert stage.editor.project is before


@pytest.mark.slow
def test_each_action_is_found_first_by_its_own_name(stage: Workspace) -> None:
    for action in stage.actions:
        assert stage.actions.find(action.label)[0].label == action.label


@given(st.text("abcdefgh ", min_size=1, max_size=12), st.data())
def test_letters_of_a_name_in_their_order_find_it_and_no_others_do(name: str, data: st.DataObject) -> None:
    kept = data.draw(st.lists(st.booleans(), min_size=len(name), max_size=len(name)))
    typed = "".join(letter for letter, keep in zip(name, kept, strict=True) if keep)
    assert score_match(typed, name) is not None
    backwards = iter(name)
    inside = all(letter in backwards for letter in typed[::-1].replace(" ", ""))
    assert (score_match(typed[::-1], name) is not None) == inside


def test_the_start_of_words_and_letters_in_a_row_are_likelier(stage: Workspace) -> None:
    ids_for = lambda typed: [action.id for action in stage.actions.find(typed)]  # noqa: E731
    assert ids_for("cm")[:2] in (["motion.copy", "motion.clear"], ["motion.clear", "motion.copy"])
    assert ids_for("undo")[0] == "edit.undo" and ids_for("no such thing") == []


def test_last_action_is_offered_first(stage: Workspace) -> None:
    stage.actions.do("view.bones")
    stage.actions.do("view.bones")
    finding = PaletteSearch(stage.actions)
    assert finding.matches[0].id == "view.bones" and len(finding.matches) == len(list(stage.actions))
    finding.move_highlight(-1)
    assert finding.highlighted == len(finding.matches) - 1
    assert finding.highlighted_action() is None, "the last lacks a stage"
    finding.set_text("undo")
    assert finding.highlighted == 0


ROOMS: dict[str, tuple[str, ...]] = {"d": ("Here",), "e": ("Here", "There"), "f": ("There",)}


def table(folder: Path, done: list[str]) -> ActionTable:
    """Returns three actions with global keys, one without a key, and three with keys of their workspaces."""
    actions = ActionTable(Toasts(6.0), Preferences(folder))
    keys = {"a": ("x",), "b": ("ctrl+y", "z"), "c": (), "d": ("x",), "e": ("f5",), "f": ("x",)}
    for name, own in keys.items():
        rooms = ROOMS.get(name, ())
        deed = lambda name=name: done.append(name)  # noqa: E731
        actions.add(Action(name, "Menu", name.upper(), own, deed, workspaces=rooms))
    return actions


keys = st.sampled_from(["x", "ctrl+y", "z", "f5", "shift+left"])
deeds = st.one_of(
    st.tuples(st.just("set_shortcut"), st.sampled_from("abcdef"), keys),
    st.tuples(st.just("clear_shortcuts"), st.sampled_from("abcdef"), st.just("")),
    st.just(("reset_shortcuts", "", "")),
)


@pytest.mark.slow
@given(st.lists(deeds, max_size=8))
def test_a_key_does_one_action_at_most_and_changed_keys_are_kept(tmp_path_factory, todo) -> None:
    folder, done = tmp_path_factory.mktemp("keys"), list[str]()
    actions = table(folder, done)
    for name, action, key in todo:
        getattr(actions, name)(*(part for part in (action, key) if part))
        if name == "set_shortcut":
            assert all(actions.find_by_shortcut(key, room).id == action for room in ROOMS.get(action, ("",)))
        elif name == "reset_shortcuts":
            assert not actions.has_custom_shortcuts and actions.find_by_shortcut("x").id == "a"
    reopened = table(folder, done)
    assert [reopened.find_shortcuts(action) for action in reopened] == [
        actions.find_shortcuts(action) for action in actions
    ]
    for room in ("", "Here", "There"):
        in_room = [
            action for action in actions if (room in action.workspaces if room else not action.workspaces)
        ]
        room_keys = [key for action in in_room for key in actions.find_shortcuts(action)]
        assert len(room_keys) == len(set(room_keys)), "a key has one meaning in a workspace"
        reopened.workspace = lambda room=room: room
        for key in room_keys:
            done.clear()
            assert reopened.press(key, workspace_only=bool(room)) and done == [
                actions.find_by_shortcut(key, room).id
            ]


def test_keys_of_a_workspace_are_free_in_the_others(tmp_path) -> None:
    done = list[str]()
    actions = table(tmp_path, done)
    for room in ("", "Here", "There"):
        actions.workspace = lambda room=room: room
        assert actions.press("x", workspace_only=True) is bool(room) and actions.press("x")
    assert done == ["a", "d", "a", "f", "a"]
    actions.set_shortcut("e", "x")
    assert [actions.find_shortcuts(actions[action_id]) for action_id in "adef"] == [("x",), (), ("x",), ()]


def test_an_action_that_takes_anothers_key_or_name_is_refused(tmp_path) -> None:
    actions = table(tmp_path, [])
    for name, key in (("a", "f9"), ("g", "z")):
        with pytest.raises(InputError):
            actions.add(Action(name, "Menu", "D", (key,), list))


def test_a_damaged_file_of_preferences_is_put_aside(tmp_path) -> None:
    kept = Preferences(tmp_path)
    kept.keys["a"] = ("f5",)
    kept.save()
    assert Preferences(tmp_path).keys == {"a": ("f5",)}
    kept.path.write_text('{"keys": 3}')
    assert Preferences(tmp_path).keys == {} and kept.path.with_suffix(".damaged").exists()


def test_keys_are_written_as_on_a_keyboard() -> None:
    assert [format_key(key) for key in ("ctrl+shift+z", "delete", "ctrl+comma", "f1", "page_up")] == [
        "Ctrl+Shift+Z",
        "Del",
        "Ctrl+,",
        "F1",
        "PgUp",
    ]
