"""Actions on the selection: select all, nothing, or the others; and actions that need a single shape."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from enliven_viewer.language import tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.editor.editor import Editor


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

    description = "Hidden and locked shapes are never chosen."
    yield Action("edit.all", "Edit", "Choose all", ("ctrl+a",), every, empty, about=description, apart=True)
    yield Action(
        "edit.none", "Edit", "Choose none", ("ctrl+shift+a",), lambda: editor.select_only(None), none
    )
    yield Action(
        "edit.inverse", "Edit", "Invert the selection", ("ctrl+i",), inverse, empty, about=description
    )
