"""The actions of the outliner: select, rename, hide, lock and reorder."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from enliven_viewer.language import tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.outliner.outliner import Outliner


def require_single_shape(action: Action, editor: Editor) -> Action:
    """Returns the action with an additional check: if several shapes are selected, it is unavailable and
    gives this reason.
    """

    def lacks() -> str:
        reason = "Several shapes are chosen. Choose one of them alone first."
        return reason if editor.selection.has_several else action.why_not()

    return replace(action, why_not=lacks)


def make_choosing_actions(editor: Editor) -> Iterator[Action]:
    """Yields the actions that select all, select nothing, or invert the selection."""

    def empty() -> str:
        return (
            ""
            if editor.pickable_characters
            else tr("There is nothing to choose. Sketch a part, or open a model.")
        )

    def none() -> str:
        return "" if editor.selection.characters else tr("Nothing is chosen.")

    def every() -> None:
        editor.choose_all(*(character.id for character in editor.pickable_characters))

    def inverse() -> None:
        chosen = editor.selection.characters
        editor.choose_all(
            *(character.id for character in editor.pickable_characters if character.id not in chosen)
        )

    about = "Hidden and locked shapes are left out."
    yield Action("edit.all", "Edit", "Choose all", ("ctrl+a",), every, empty, about=about, apart=True)
    yield Action("edit.none", "Edit", "Choose nothing", ("ctrl+shift+a",), lambda: editor.choose(None), none)
    yield Action("edit.inverse", "Edit", "Choose the others", ("ctrl+i",), inverse, empty, about=about)


def make_outliner_actions(outliner: Outliner) -> Iterator[Action]:
    """Yields the actions that rename, hide, lock and reorder the selection."""
    editor = outliner.editor

    def chosen() -> tuple[str, ...]:
        return tuple(character.id for character in editor.selected_characters)

    def lacks() -> str:
        return "" if chosen() else "Nothing is chosen. Click a shape first."

    def hidden() -> list[str]:
        return [name for name, handling in editor.project.handling.items() if handling.hidden]

    def locked() -> list[str]:
        return [name for name, handling in editor.project.handling.items() if handling.locked]

    def all_hidden() -> bool:
        return bool(chosen()) and set(chosen()) <= set(hidden())

    def all_locked() -> bool:
        return bool(chosen()) and set(chosen()) <= set(locked())

    def step(direction: int) -> None:
        name = editor.selection.character or ""
        outliner.move(name, outliner.find_place(name) + direction)

    def lacks_place(direction: int) -> str:
        if lacks() or editor.selection.has_several:
            return lacks() or "Several shapes are chosen. Choose one to move it in the list."
        place = outliner.find_place(editor.selection.character or "") + direction
        inside = 0 <= place < len(editor.project.characters)
        return "" if inside else "It is at the end of the list."

    yield Action("shape.rename", "Shape", "Rename", ("f2",), outliner.begin_rename, lacks, apart=True)
    yield Action(
        "shape.hide",
        "Shape",
        "Hide",
        ("shift+h",),
        lambda: outliner.hide(*chosen(), on=not all_hidden()),
        lacks,
        all_hidden,
        "Hides it in this window only; exports and the stage do not change.",
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
        lambda: outliner.hide(*hidden(), on=False),
        lambda: "" if hidden() else tr("Nothing is hidden."),
    )
    yield Action(
        "shape.lock",
        "Shape",
        "Lock",
        ("ctrl+l",),
        lambda: outliner.lock(*chosen(), on=not all_locked()),
        lacks,
        all_locked,
        "Locked shapes cannot be picked or edited.",
    )
    yield Action(
        "shape.unlock_all",
        "Shape",
        "Unlock everything",
        ("ctrl+shift+l",),
        lambda: outliner.lock(*locked(), on=False),
        lambda: "" if locked() else tr("Nothing is locked."),
    )
    for name, direction in (("up", -1), ("down", 1)):
        yield Action(
            f"shape.{name}",
            "Shape",
            f"{name.title()} in the list",
            (f"alt+{name}",),
            lambda direction=direction: step(direction),
            lambda direction=direction: lacks_place(direction),
        )
