"""The actions of the outliner: select, rename, hide, lock and reorder."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from enliven_viewer.language import tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.features.outliner.outliner import Outliner


def make_outliner_actions(outliner: Outliner) -> Iterator[Action]:
    """Yields the actions that rename, hide, lock and reorder the selection."""
    lacks = partial(_describe_missing_selection, outliner)
    yield Action("shape.rename", "Shape", "Rename", ("f2",), outliner.begin_rename, lacks, apart=True)
    yield from _make_hide_actions(outliner)
    yield from _make_lock_actions(outliner)
    yield from _make_order_actions(outliner)


def _make_hide_actions(outliner: Outliner) -> Iterator[Action]:
    lacks = partial(_describe_missing_selection, outliner)

    def hidden() -> list[str]:
        return [name for name, handling in outliner.editor.project.handling.items() if handling.hidden]

    def all_hidden() -> bool:
        return bool(_list_selected(outliner)) and set(_list_selected(outliner)) <= set(hidden())

    yield Action(
        "shape.hide",
        "Shape",
        "Hide",
        ("shift+h",),
        lambda: outliner.set_hidden(*_list_selected(outliner), is_hidden=not all_hidden()),
        lacks,
        all_hidden,
        "Hides the chosen shapes in this window only. Exports and the stage do not change.",
    )
    yield Action(
        "shape.hide_others",
        "Shape",
        "Hide the others",
        ("shift+i",),
        outliner.hide_others,
        lacks,
        about="Shows only the chosen shapes.",
    )
    yield Action(
        "shape.show_all",
        "Shape",
        "Show everything",
        ("alt+h",),
        lambda: outliner.set_hidden(*hidden(), is_hidden=False),
        lambda: "" if hidden() else tr("Nothing is hidden."),
    )


def _make_lock_actions(outliner: Outliner) -> Iterator[Action]:
    def locked() -> list[str]:
        return [name for name, handling in outliner.editor.project.handling.items() if handling.locked]

    def all_locked() -> bool:
        return bool(_list_selected(outliner)) and set(_list_selected(outliner)) <= set(locked())

    yield Action(
        "shape.lock",
        "Shape",
        "Lock",
        ("ctrl+l",),
        lambda: outliner.set_locked(*_list_selected(outliner), is_locked=not all_locked()),
        partial(_describe_missing_selection, outliner),
        all_locked,
        "Locked shapes cannot be picked or edited.",
    )
    yield Action(
        "shape.unlock_all",
        "Shape",
        "Unlock everything",
        ("ctrl+shift+l",),
        lambda: outliner.set_locked(*locked(), is_locked=False),
        lambda: "" if locked() else tr("Nothing is locked."),
    )


def _make_order_actions(outliner: Outliner) -> Iterator[Action]:
    editor = outliner.editor

    def step(direction: int) -> None:
        name = editor.selection.character or ""
        outliner.move(name, outliner.find_place(name) + direction)

    def describe_missing_place(direction: int) -> str:
        lacks = _describe_missing_selection(outliner)
        if lacks or editor.selection.has_several:
            return lacks or "Several shapes are chosen. Choose one shape to move it in the list."
        place = outliner.find_place(editor.selection.character or "") + direction
        inside = 0 <= place < len(editor.project.characters)
        return "" if inside else "The shape is already at this end of the list."

    for name, direction in (("up", -1), ("down", 1)):
        yield Action(
            f"shape.{name}",
            "Shape",
            f"Move {name} in the list",
            (f"alt+{name}",),
            partial(step, direction),
            partial(describe_missing_place, direction),
        )


def _list_selected(outliner: Outliner) -> tuple[str, ...]:
    """Returns the ids of the selected characters."""
    return tuple(character.id for character in outliner.editor.selected_characters)


def _describe_missing_selection(outliner: Outliner) -> str:
    """Returns advice if no character is selected, otherwise an empty text."""
    return "" if _list_selected(outliner) else "Nothing is chosen. Click a shape first."
