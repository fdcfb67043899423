"""Camera bookmarks: views that are stored in the project and can be restored."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from enliven.document import CameraMark
from enliven_viewer.language import later, tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.editor.editor import Editor

_VIEW_NUMBERS = (1, 2, 3, 4)
"""The bookmarks with a shortcut."""
_FUNCTION_KEY_OFFSET = 4
"""Offset from a bookmark's number to its function key. The first is F5, because F1 opens the help and F2
renames.
"""


def make_view_actions(editor: Editor) -> Iterator[Action]:
    """Yields the actions that store the current view and restore a stored one."""
    for number in _VIEW_NUMBERS:
        name, key = tr("view {0}", number), f"f{number + _FUNCTION_KEY_OFFSET}"
        yield Action(
            f"view.take_{number}",
            "View",
            f"Bookmark {number}",
            (key,),
            lambda name=name: restore_view(editor, name),
            lambda name=name, key=key: _lacks_view(editor, name, key),
            about="Returns to the stored view.",
            apart=number == 1,
            group="Bookmarks",
        )
    for number in _VIEW_NUMBERS:
        name = tr("view {0}", number)
        yield Action(
            f"view.store_{number}",
            "View",
            f"Store as bookmark {number}",
            (f"ctrl+f{number + _FUNCTION_KEY_OFFSET}",),
            lambda name=name: store_view(editor, name),
            about="It is saved with the project.",
            apart=number == 1,
            group="Bookmarks",
        )


def store_view(editor: Editor, name: str) -> None:
    """Stores the current view in the project, as one edit."""
    *target, azimuth, elevation, distance = editor.camera.goal
    mark = CameraMark(name, (target[0], target[1], target[2]), azimuth, elevation, distance)
    if editor.edit(
        later("store {0}", later("view {0}", name.rpartition(" ")[2])),
        lambda p: replace(p, views={**p.views, name: mark}),
    ):
        editor.toasts.say(
            tr("Stored as bookmark {0}", name.rpartition(" ")[2]), tr("It is saved with the project.")
        )


def restore_view(editor: Editor, name: str) -> None:
    """Restores a stored view."""
    mark = editor.project.views[name]
    editor.camera_moves.follow = editor.camera_moves.turntable = False
    editor.camera.go(mark.target, mark.azimuth, mark.elevation, mark.distance)


def _lacks_view(editor: Editor, name: str, key: str) -> str:
    advice = tr("Nothing is stored there. Ctrl+{0} stores the current view.", key.upper())
    return "" if name in editor.project.views else advice
