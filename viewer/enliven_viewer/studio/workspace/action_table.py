"""The actions of the studio's own menus.

Menus, shortcuts, buttons, command palette and help are built from them.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Protocol

from enliven.document import ExampleCharacter
from enliven.errors import EnlivenError
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.app.viewport_input import ViewportInput, make_tool_action
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.editor.selection_actions import make_choosing_actions, require_single_shape
from enliven_viewer.studio.preferences import Preferences
from enliven_viewer.studio.tools.registry import TOOLS
from enliven_viewer.studio.workspace.commands import Commands
from enliven_viewer.studio.workspace.files import SAMPLES, list_exportable
from enliven_viewer.studio.workspace.model_size import make_fitting_actions
from enliven_viewer.studio.workspace.view_actions import (
    make_camera_actions,
    make_reading_actions,
    make_view_actions,
)

_SINGLE_SHAPE_ACTIONS = (
    "file.session",
    *(f"motion.{deed}" for deed in ("copy", "paste", "spread", "clear", "pin")),
    "shape.solve",
    "view.best",
)
"""Actions that work on a single shape. If several shapes are selected, these actions are disabled and show
the reason.
"""
_TIME_SHIFT_S = 0.1
"""Time shift in seconds per key press: clearly visible, but small enough to stagger copies."""


class WindowCommands(Protocol):
    """The commands of the window that create, open and close projects, and open dialogues."""

    def open_dialogue(self, name: str) -> None:
        """Opens a dialogue."""

    def start_project(self) -> None:
        """Starts a new project."""

    def open_recent(self) -> None:
        """Opens the last file again."""

    def save_or_ask(self) -> None:
        """Saves the project. Asks for a name if it has none."""

    def quit(self) -> None:
        """Closes the studio."""

    def toggle_start_page(self) -> None:
        """Shows or hides the start page."""

    def toggle_history(self) -> None:
        """Shows or hides the list of edits."""

    def add_sample(self, name: str) -> None:
        """Adds a sample."""


def make_studio_actions(
    commands: Commands, user_input: ViewportInput, window: WindowCommands, preferences: Preferences
) -> Iterator[Action]:
    """Yields every action of the studio's own menus, in menu order."""
    editor = commands.editor
    for action in _make_actions(commands, user_input, window, preferences):
        yield require_single_shape(action, editor) if action.id in _SINGLE_SHAPE_ACTIONS else action


def _make_actions(
    commands: Commands, user_input: ViewportInput, window: WindowCommands, preferences: Preferences
) -> Iterator[Action]:
    show = window.open_dialogue
    yield from _make_file_actions(window, preferences)
    yield from _make_export_actions(commands, window)
    yield from _make_edit_actions(commands, user_input, window)
    yield from make_choosing_actions(commands.editor)
    yield _make_snap_action(commands.editor)
    yield from _make_motion_actions(commands)
    yield from _make_key_actions(commands)
    yield from _make_shape_actions(commands)
    yield from make_fitting_actions(commands.fitting)
    yield from (make_tool_action(user_input, kind) for kind in TOOLS)
    yield from make_camera_actions(commands)
    yield from make_view_actions(commands.editor)
    yield from make_reading_actions(preferences)
    yield Action("help.palette", "Help", "Find an action...", ("ctrl+k",), lambda: show("palette"))
    yield Action(
        "help.start",
        "Help",
        "Start page",
        (),
        window.toggle_start_page,
        about="Shows the start page with samples and recent files.",
    )
    for name, label in SAMPLES.items():
        do = partial(window.add_sample, name)
        yield Action(
            f"sample.{name}", "Help", label, (), do, about="Opens a sample character.", apart=name == "cactus"
        )
    yield Action("help.keys", "Help", "Keyboard shortcuts", ("f1", "h"), lambda: show("help"))


def _make_file_actions(window: WindowCommands, preferences: Preferences) -> Iterator[Action]:
    show = window.open_dialogue

    def describe_missing_recent() -> str:
        return "" if preferences.recent else "No file was opened yet. Press Ctrl+O to open a file."

    yield Action("file.new", "File", "New", ("ctrl+n",), window.start_project)
    yield Action(
        "file.open",
        "File",
        "Open...",
        ("ctrl+o",),
        lambda: show("open"),
        about="Opens a project, a model, a mesh or a take.",
    )
    description = "Reopen the last file"
    yield Action(
        "file.again", "File", description, ("ctrl+shift+o",), window.open_recent, describe_missing_recent
    )
    yield Action("file.save", "File", "Save", ("ctrl+s",), window.save_or_ask, apart=True)
    yield Action("file.save_as", "File", "Save as...", ("ctrl+shift+s",), lambda: show("save as"))


def _make_export_actions(commands: Commands, window: WindowCommands) -> Iterator[Action]:
    show = window.open_dialogue

    def describe_missing_export() -> str:
        try:
            list_exportable(commands.editor.project)
        except EnlivenError as error:
            return f"{error.what[0].upper()}{error.what[1:]}. {error.remedy}"
        return ""

    def describe_missing_puppet() -> str:
        return (
            ""
            if commands.editor.find_selected(ExampleCharacter)
            else "No puppet is chosen. Click a puppet first."
        )

    yield Action(
        "file.export",
        "File",
        "Export...",
        ("ctrl+e",),
        lambda: show("export"),
        describe_missing_export,
        about="Exports all shapes with their motion for other programs: as GLB, or as "
        "BVH for one shape with bones.",
        apart=True,
    )
    yield Action(
        "file.film",
        "File",
        "Film...",
        ("ctrl+shift+f",),
        lambda: show("film"),
        describe_missing_export,
        about="Renders all shapes in motion as an MP4 film.",
    )
    yield Action(
        "file.session",
        "File",
        "Save the puppet's examples...",
        ("ctrl+shift+e",),
        lambda: show("session"),
        describe_missing_puppet,
        about="Saves the puppet's control points and key poses in a text file that you can edit.",
    )
    yield Action(
        "file.preferences",
        "File",
        "Preferences...",
        ("ctrl+comma",),
        lambda: show("preferences"),
        apart=True,
    )
    yield Action("file.quit", "File", "Quit", ("ctrl+q",), window.quit, apart=True)


def _make_edit_actions(
    commands: Commands, user_input: ViewportInput, window: WindowCommands
) -> Iterator[Action]:
    c, editor = commands, commands.editor
    yield Action("edit.undo", "Edit", "Undo", ("ctrl+z",), editor.undo, c.describe_missing_undo)
    yield Action(
        "edit.redo", "Edit", "Redo", ("ctrl+shift+z", "ctrl+y"), editor.redo, c.describe_missing_redo
    )
    yield Action(
        "edit.history",
        "Edit",
        "History",
        ("ctrl+h",),
        window.toggle_history,
        about="Lists all edits. Click an edit to return to that state.",
    )
    yield Action("edit.copy", "Edit", "Copy", ("ctrl+c",), c.copy, c.describe_missing_character, apart=True)
    yield Action("edit.cut_out", "Edit", "Cut out", ("ctrl+x",), c.cut_out, c.describe_missing_character)
    yield Action("edit.paste", "Edit", "Paste", ("ctrl+v",), c.paste, c.describe_missing_copied)
    yield Action(
        "edit.duplicate", "Edit", "Duplicate", ("ctrl+d",), c.duplicate, c.describe_missing_character
    )
    yield Action(
        "edit.delete",
        "Edit",
        "Delete",
        ("delete", "backspace"),
        c.delete,
        c.describe_missing_character,
        about="Deletes the chosen node, or the whole shape if no node is chosen.",
    )
    yield Action(
        "edit.drop", "Edit", "Cancel the current operation", ("escape",), user_input.cancel_tool, apart=True
    )


def _make_snap_action(editor: Editor) -> Action:
    def toggle() -> None:
        editor.snapping.is_on = not editor.snapping.is_on

    description = (
        "Moves snap to a grid of 10 cm and to the floor, rotations to steps of 15 degrees. Hold Ctrl "
        "while you drag to switch snapping off or on."
    )
    is_on = lambda: editor.snapping.is_on  # noqa: E731
    return Action(
        "edit.snap", "Edit", "Snap", ("shift+n",), toggle, is_on=is_on, about=description, apart=True
    )


def _make_motion_actions(c: Commands) -> Iterator[Action]:
    yield Action(
        "motion.copy",
        "Motion",
        "Copy motion",
        ("ctrl+shift+c",),
        c.motion.copy,
        c.motion.describe_missing_copy,
        about="Copies the motion of the chosen chain, or the performance of the chosen character.",
    )
    yield Action(
        "motion.paste",
        "Motion",
        "Paste motion",
        ("ctrl+shift+v",),
        c.motion.paste,
        c.motion.describe_missing_paste,
        about="Pastes motion onto the chosen chain, or a performance onto the chosen character.",
    )
    yield Action(
        "motion.spread",
        "Motion",
        "Copy to equal limbs",
        ("ctrl+shift+d",),
        c.copy_to_equal_limbs,
        c.describe_missing_limb,
        about="Copies the motion of the chosen limb to all limbs with the same form.",
    )
    yield Action(
        "motion.clear",
        "Motion",
        "Clear motion",
        ("ctrl+shift+x",),
        c.clear_motion,
        c.describe_missing_shape,
        about="Removes all motion from the chosen chain, or from the whole shape.",
    )
    for name, label, seconds in (("later", "Later", _TIME_SHIFT_S), ("earlier", "Earlier", -_TIME_SHIFT_S)):
        yield Action(
            f"motion.{name}",
            "Motion",
            label,
            (f"ctrl+alt+{'right' if seconds > 0 else 'left'}",),
            lambda seconds=seconds: c.shift(seconds),
            c.describe_missing_playback,
            about="Shifts all motion of the chosen shapes by a tenth of a second.",
            apart=seconds > 0,
        )
    yield Action(
        "motion.mute", "Motion", "Mute", ("shift+u",), c.toggle_mute, c.describe_missing_playback, c.is_muted
    )
    yield Action(
        "motion.pin",
        "Motion",
        "Pin or free a foot",
        ("p",),
        c.pin_foot,
        c.describe_missing_foot,
        about="A pinned foot does not slide while it touches the floor.",
    )


def _make_key_actions(c: Commands) -> Iterator[Action]:
    yield Action(
        "motion.keying",
        "Motion",
        "Keys while posing",
        ("shift+k",),
        c.keys.toggle,
        is_on=lambda: c.editor.is_auto_key,
        about="Posing (R) or moving (G) a joint, a node or a whole shape also sets a key at the playhead.",
        apart=True,
    )
    description = "Sets a key with the current pose at the playhead. You can drag the key in the curves."
    yield Action(
        "motion.key",
        "Motion",
        "Set a key at the playhead",
        ("ctrl+j",),
        c.keys.set,
        c.keys.describe_missing,
        about=description,
    )
    away = "Remove the key at the playhead"
    yield Action(
        "motion.unkey", "Motion", away, ("ctrl+shift+j",), c.keys.remove, c.keys.describe_missing_key
    )


def _make_shape_actions(c: Commands) -> Iterator[Action]:
    turns = (
        ("left", "Turn left", 15.0, "left"),
        ("right", "Turn right", -15.0, "right"),
        ("over", "Turn over", 180.0, "up"),
    )
    yield Action(
        "shape.mirror",
        "Shape",
        "Mirror",
        ("ctrl+m",),
        c.mirror,
        c.describe_missing_character,
        about="Mirrors the chosen shapes: swaps left and right, as seen from the camera.",
    )
    yield Action(
        "shape.larger",
        "Shape",
        "Larger",
        ("ctrl+equal",),
        lambda: c.scale(1.1),
        c.describe_missing_character,
        about="Changes the size of the chosen shapes by a tenth.",
    )
    yield Action(
        "shape.smaller",
        "Shape",
        "Smaller",
        ("ctrl+minus",),
        lambda: c.scale(1 / 1.1),
        c.describe_missing_character,
        about="Changes the size of the chosen shapes by a tenth.",
    )
    for name, label, degrees, key in turns:
        yield Action(
            f"shape.turn_{name}",
            "Shape",
            label,
            (f"ctrl+{key}",),
            lambda degrees=degrees: c.turn(degrees),
            c.describe_missing_character,
            about=f"Turns the chosen shapes by {abs(degrees):.0f} degrees, as seen from the camera.",
        )
    yield Action(
        "shape.solve",
        "Shape",
        "Apply the performance again",
        ("ctrl+shift+p",),
        c.motion.solve_again,
        c.motion.describe_missing_possessed,
        about="Applies the recorded performance again to the changed shape, for example after a cut.",
        apart=True,
    )
