"""The actions of the outliner: select, rename, hide, lock and reorder."""

from __future__ import annotations

from collections.abc import Iterator

from enliven_viewer.language import tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.features.outliner.outliner import Outliner


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

    def describe_missing_place(direction: int) -> str:
        if lacks() or editor.selection.has_several:
            return lacks() or "Several shapes are chosen. Choose one shape to move it in the list."
        place = outliner.find_place(editor.selection.character or "") + direction
        inside = 0 <= place < len(editor.project.characters)
        return "" if inside else "The shape is already at this end of the list."

    yield Action("shape.rename", "Shape", "Rename", ("f2",), outliner.begin_rename, lacks, apart=True)
    yield Action(
        "shape.hide",
        "Shape",
        "Hide",
        ("shift+h",),
        lambda: outliner.set_hidden(*chosen(), is_hidden=not all_hidden()),
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
    yield Action(
        "shape.lock",
        "Shape",
        "Lock",
        ("ctrl+l",),
        lambda: outliner.set_locked(*chosen(), is_locked=not all_locked()),
        lacks,
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
    for name, direction in (("up", -1), ("down", 1)):
        yield Action(
            f"shape.{name}",
            "Shape",
            f"Move {name} in the list",
            (f"alt+{name}",),
            lambda direction=direction: step(direction),
            lambda direction=direction: describe_missing_place(direction),
        )
