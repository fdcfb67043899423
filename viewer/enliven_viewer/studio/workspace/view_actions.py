"""The actions of the View menu: bones, text size and theme, the camera, and camera bookmarks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from enliven.document import CameraMark
from enliven_viewer.language import later, tr
from enliven_viewer.render.stage_look import LOOKS
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.editor.path_framing import frame_path
from enliven_viewer.studio.preferences import TEXT_SIZES, Preferences
from enliven_viewer.studio.workspace.commands import Commands
from enliven_viewer.theme import is_light

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
            lambda name=name, key=key: _describe_missing_view(editor, name, key),
            about="Returns to the view that is stored in this bookmark.",
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
            about="The bookmark is saved with the project.",
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
        editor.toasts.show_message(
            tr("Stored as bookmark {0}", name.rpartition(" ")[2]),
            tr("The bookmark is saved with the project."),
        )


def restore_view(editor: Editor, name: str) -> None:
    """Restores a stored view."""
    mark = editor.project.views[name]
    editor.camera_moves.follow = editor.camera_moves.turntable = False
    editor.camera.go(mark.target, mark.azimuth, mark.elevation, mark.distance)


def _describe_missing_view(editor: Editor, name: str, key: str) -> str:
    advice = tr("This bookmark is empty. Press Ctrl+{0} to store the current view.", key.upper())
    return "" if name in editor.project.views else advice


def make_reading_actions(preferences: Preferences) -> Iterator[Action]:
    """Yields the actions for text size, theme and animation."""

    def at_end(size: float, size_name: str) -> str:
        return tr("The text already has the {0} size.", size_name) if preferences.text_size == size else ""

    yield Action(
        "view.larger_text",
        "View",
        "Larger text",
        ("ctrl+shift+equal",),
        lambda: preferences.resize(1),
        lambda: at_end(TEXT_SIZES[-1], tr("largest")),
        about="Changes the size of text and of all panels.",
        apart=True,
    )
    yield Action(
        "view.smaller_text",
        "View",
        "Smaller text",
        ("ctrl+shift+minus",),
        lambda: preferences.resize(-1),
        lambda: at_end(TEXT_SIZES[0], tr("smallest")),
        about="Changes the size of text and of all panels.",
    )
    yield Action(
        "view.light_theme",
        "View",
        "Light theme",
        (),
        lambda: preferences.set_colours("dark" if is_light() else "light"),
        is_on=is_light,
        about="Dark text on light panels, and a bright stage.",
    )
    yield Action(
        "view.less_motion",
        "View",
        "Less motion",
        (),
        preferences.set_less_motion,
        is_on=lambda: preferences.less_motion,
        about="The view jumps to its new direction at once, without animation.",
    )
    yield Action(
        "view.performer",
        "View",
        "Camera preview",
        ("alt+p",),
        preferences.watch_performer,
        is_on=lambda: preferences.performer,
        about="Shows the performers as seen by their cameras, side by side if there are several.",
    )


def _switch_look(editor: Editor) -> None:
    """Switches the stage to the next look."""
    names = list(LOOKS)
    editor.look = names[(names.index(editor.look) + 1) % len(names)]
    editor.toasts.show_message(tr("Look: {0}", tr(editor.look)))


def make_camera_actions(c: Commands) -> Iterator[Action]:
    """Yields the actions for the visibility of bones and for the camera."""
    editor, right = c.editor, np.pi / 2
    yield Action(
        "view.bones", "View", "Bones", ("b",), c.toggle_bones, is_on=lambda: editor.show_bones, apart=True
    )
    yield Action(
        "view.all", "View", "Frame everything", ("f",), lambda: editor.frame_all(reset=False), apart=True
    )
    yield Action(
        "view.way",
        "View",
        "Frame the whole path",
        ("ctrl+f",),
        lambda: frame_path(editor),
        about="Shows the whole path of the chosen shape, or of all shapes if none is chosen.",
    )
    yield Action(
        "view.follow",
        "View",
        "Follow the character",
        ("shift+f",),
        editor.camera_moves.toggle_follow,
        is_on=lambda: editor.camera_moves.follow,
        about="The view follows the chosen character, or all characters, and keeps its direction.",
    )
    yield Action(
        "view.turntable",
        "View",
        "Turntable",
        ("shift+t",),
        editor.camera_moves.toggle_turntable,
        is_on=lambda: editor.camera_moves.turntable,
        about="The view slowly circles the shapes.",
    )
    yield Action(
        "view.look",
        "View",
        "Next look",
        ("shift+l",),
        lambda: _switch_look(editor),
        about="Switches to the next preset of light, backdrop and floor: studio, night, white, dawn, garden.",
    )
    sides = (
        ("front", "1", 0.0, 0.0),
        ("back", "2", np.pi, 0.0),
        ("right", "3", right, 0.0),
        ("above", "7", 0.0, right),
    )
    for name, key, around, up in sides:
        label = "From above" if name == "above" else f"From the {name}"
        face = lambda to=(around, up): editor.camera.face(*to)  # noqa: E731
        yield Action(f"view.{name}", "View", label, (key,), face, group="From a side")
    yield Action(
        "view.best",
        "View",
        "Best view of the bones",
        ("v",),
        c.show_best_view,
        c.describe_missing_shape,
        group="From a side",
        about="Turns the view so that the bones of the chosen shape overlap as little as possible.",
    )
