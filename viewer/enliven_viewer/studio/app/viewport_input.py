"""Passes mouse buttons, wheel and keys over the viewport to the active tool, the camera or an action."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from enliven_viewer.render.camera import TURN_PER_PIXEL
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.actions.table import ActionTable
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.tools.registry import TOOLS
from enliven_viewer.studio.viewport.overlay import Point

LEFT_BUTTON = 0
"""ImGui's number of the left button, which uses the active tool."""
RIGHT_BUTTON = 1
"""The right button, which orbits the camera."""
MIDDLE_BUTTON = 2
"""The middle button, which pans the camera."""


class Handles(Protocol):
    """Draggable handles over the viewport that take precedence over the active tool."""

    def press(self, at: Point) -> bool:
        """Handles a press of the left button. Returns True if a handle was grabbed."""

    def drag(self, at: Point) -> None:
        """Handles pointer movement while a handle is held."""

    def release(self) -> None:
        """Handles the release of the button."""


class ViewportInput:
    """Passes the input over the viewport to the active tool, the camera or an action.

    Args:
        editor: the editor that the input changes.
        actions: the actions for keys that the active tool does not handle.

    Attributes:
        key_filter: called with every key before the tool. Returns True if it has handled the key.
        handles: handles that get the left button before the tool.
    """

    def __init__(self, editor: Editor, actions: ActionTable) -> None:
        self.editor, self.actions = editor, actions
        self.tools = {kind.name: kind(editor) for kind in TOOLS}
        self.tool: Tool = self.tools[TOOLS[0].name]
        self.at: Point = (0.0, 0.0)
        self.key_filter: Callable[[str], bool] = lambda key: False
        self._held_button: int | None = None
        self._is_tool_drag = self._resumes_playback = False
        self.handles: list[Handles] = []
        self._grabbed_handles: Handles | None = None

    def activate_tool(self, name: str) -> None:
        """Makes another tool the active one."""
        self.tool.cancel()
        self.tool = self.tools[name]

    def press(
        self,
        at: Point,
        button: int = LEFT_BUTTON,
        *,
        shift: bool = False,
        ctrl: bool = False,
        is_finger: bool = False,
    ) -> None:
        """Handles the press of a mouse button, a pen or a finger over the viewport."""
        if self._held_button is not None:
            return
        self._held_button, self.at = button, at
        self._resumes_playback = self.tool.plays_on and self.editor.playing
        if button == LEFT_BUTTON:
            self._grabbed_handles = next((handles for handles in self.handles if handles.press(at)), None)
            pointer = Pointer(at, shift, ctrl, is_finger)
            self._is_tool_drag = self._grabbed_handles is None and self.tool.press(pointer)

    def move(self, at: Point, *, shift: bool = False, ctrl: bool = False) -> None:
        """Handles pointer movement."""
        across, down = at[0] - self.at[0], at[1] - self.at[1]
        self.at = at
        if self._held_button is None:
            self.tool.hover(Pointer(at, shift, ctrl))
        elif self._grabbed_handles is not None:
            self._grabbed_handles.drag(at)
        elif self._is_tool_drag:
            self.tool.drag(Pointer(at, shift, ctrl))
        elif self._held_button == MIDDLE_BUTTON or shift:
            height = max(self.editor.size[1], 1.0)
            self.editor.camera.pan(-across / height, down / height)
        else:
            self.editor.camera.orbit(-TURN_PER_PIXEL * across, TURN_PER_PIXEL * down)

    def release(
        self, at: Point, button: int = LEFT_BUTTON, *, shift: bool = False, ctrl: bool = False
    ) -> None:
        """Handles the release of a mouse button."""
        if self._held_button != button:
            return
        if self._grabbed_handles is not None:
            self._grabbed_handles.release()
        elif self._is_tool_drag:
            self.tool.release(Pointer(at, shift, ctrl))
        self._release_button()

    def wheel(self, up: float) -> None:
        """Zooms with the mouse wheel."""
        self.editor.camera.zoom(0.88**up)

    @property
    def busy(self) -> bool:
        """Returns True if a button is held."""
        return self._held_button is not None

    def key(self, key: str) -> bool:
        """Handles a key such as "c", "space", "ctrl+z" or "ctrl+shift+v". Returns True if it
        had an effect.
        """
        return self.key_filter(key) or self.tool.type(key) or self.actions.press(key)

    def cancel_tool(self) -> None:
        """Cancels the tool's current operation."""
        self.tool.cancel()
        self._release_button()

    def _release_button(self) -> None:
        """Releases the button. Resumes playback if a stroke of the tool paused it."""
        if self._is_tool_drag and self._resumes_playback:
            self.editor.playing = True
        self._held_button, self._grabbed_handles, self._is_tool_drag, self._resumes_playback = (
            None,
            None,
            False,
            False,
        )


def make_tool_action(user_input: ViewportInput, kind: type[Tool]) -> Action:
    """Returns the action that makes a tool the active one."""
    return Action(
        f"tool.{kind.name}",
        "Tools",
        kind.label,
        (kind.key,),
        lambda: user_input.activate_tool(kind.name),
        is_on=lambda: user_input.tool.name == kind.name,
        icon=kind.icon,
    )
