"""Buttons, wheel and keys over the viewport, passed to the active tool, the camera or an action."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from enliven_viewer.render import DRAG_TURN
from enliven_viewer.studio.actions import ActionTable
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.tools import TOOLS, Pointer, Tool
from enliven_viewer.studio.viewport import Point

LEFT = 0
"""The left button, as ImGui counts; it works with the tool."""
RIGHT = 1
"""The right button, which turns the camera."""
MIDDLE = 2
"""The middle button, which moves the camera."""


class Handles(Protocol):
    """What lies over the picture and is dragged, whatever the tool is."""

    def press(self, at: Point) -> bool:
        """Returns the left button went down; returns whether it takes a handle."""

    def drag(self, at: Point) -> None:
        """The pointer moved while a handle is held."""

    def release(self) -> None:
        """The button went up."""


class ViewportInput:
    """Passes the input over the viewport to the active tool, the camera or an action.

    Args:
        editor: what is edited.
        actions: what keys do where the tool has no use for them.

    Attributes:
        first: asked about every key before the tool is; True if it took it.
        over: handles that are asked about the left button before the tool is, or None.
    """

    def __init__(self, editor: Editor, actions: ActionTable) -> None:
        self.editor, self.actions = editor, actions
        self.tools = {kind.name: kind(editor) for kind in TOOLS}
        self.tool: Tool = self.tools[TOOLS[0].name]
        self.at: Point = (0.0, 0.0)
        self.first: Callable[[str], bool] = lambda key: False
        self._held: int | None = None
        self._with_tool = self._over = self._plays_on = False
        self.over: Handles | None = None

    def take(self, name: str) -> None:
        """Makes another tool the active one."""
        self.tool.cancel()
        self.tool = self.tools[name]

    def press(self, at: Point, button: int = LEFT, *, shift: bool = False, ctrl: bool = False) -> None:
        """A button went down over the viewport."""
        if self._held is not None:
            return
        self._held, self.at = button, at
        self._plays_on = self.tool.plays_on and self.editor.playing
        self._over = button == LEFT and self.over is not None and self.over.press(at)
        self._with_tool = not self._over and button == LEFT and self.tool.press(Pointer(at, shift, ctrl))

    def move(self, at: Point, *, shift: bool = False, ctrl: bool = False) -> None:
        """The pointer moved."""
        across, down = at[0] - self.at[0], at[1] - self.at[1]
        self.at = at
        if self._held is None:
            self.tool.hover(Pointer(at, shift, ctrl))
        elif self._over and self.over is not None:
            self.over.drag(at)
        elif self._with_tool:
            self.tool.drag(Pointer(at, shift, ctrl))
        elif self._held == MIDDLE or shift:
            height = max(self.editor.size[1], 1.0)
            self.editor.camera.pan(-across / height, down / height)
        else:
            self.editor.camera.orbit(-DRAG_TURN * across, DRAG_TURN * down)

    def release(self, at: Point, button: int = LEFT, *, shift: bool = False, ctrl: bool = False) -> None:
        """A button went up."""
        if self._held != button:
            return
        if self._over and self.over is not None:
            self.over.release()
        elif self._with_tool:
            self.tool.release(Pointer(at, shift, ctrl))
        self._let_go()

    def wheel(self, up: float) -> None:
        """The wheel turned over the viewport."""
        self.editor.camera.zoom(0.88**up)

    @property
    def busy(self) -> bool:
        """Returns True if a button is held."""
        return self._held is not None

    def key(self, key: str) -> bool:
        """Takes a key such as "c", "space", "ctrl+z" or "ctrl+shift+v"; returns whether it had an effect."""
        return self.first(key) or self.tool.type(key) or self.actions.press(key)

    def drop(self) -> None:
        """Drops what was begun with a tool."""
        self.tool.cancel()
        self._let_go()

    def _let_go(self) -> None:
        """Forgets the button; what played before a stroke of a tool goes on."""
        if self._with_tool and self._plays_on:
            self.editor.playing = True
        self._held, self._with_tool, self._over, self._plays_on = None, False, False, False
