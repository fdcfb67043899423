"""A stage without a window, which passes a session's input directly to the tools."""

from __future__ import annotations

import math

from enliven.errors import InputError
from enliven.modeling.edits import rename_character
from enliven_viewer.studio.app.panel_layout import lay_out_panels
from enliven_viewer.studio.features.mapping.map_tool import MapTool
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.studio.viewport.overlay import Point
from enliven_viewer.studio.workspace.workspace import Workspace
from studio_driver.actions import STEP
from studio_driver.places import source_of

_AREA = 100_000.0
"""Distance between the areas of a stage without a window, pixels. They must not overlap."""


class HeadlessStage:
    """A stage without a window. The viewport, the source view and the timeline are separate areas.

    Attributes:
        pace: duration of a pointer movement, seconds.
    """

    pace = STEP

    def __init__(self, workspace: Workspace) -> None:
        self.workspace, self.at = workspace, (0.0, 0.0)
        area = lay_out_panels(workspace.editor.settings.width, workspace.editor.settings.height).viewport
        workspace.editor.size = (area.width, area.height)
        workspace.editor.frame_all(at_once=True)
        self._shift = False
        self._in = ""

    def move(self, at: Point) -> None:
        self.at = at = float(math.floor(at[0])), float(math.floor(at[1]))  # whole pixels, like a mouse
        area = self._in or self._area()
        if area == "source":
            source_of(self.workspace).move((at[0] - _AREA, at[1]))
        elif area == "timeline":
            self.workspace.state(TimelineInput).drag(at[0] - 2 * _AREA)
        else:
            self.workspace.input.move(at, shift=self._shift)

    def button(self, button: int, down: bool) -> None:
        area, x = self._in or self._area(), self.at[0]
        self._in = area if down else ""
        if area == "source":
            source = source_of(self.workspace)
            source.press((x - _AREA, self.at[1])) if down else source.release()
        elif area == "timeline":
            timeline = self.workspace.state(TimelineInput)
            timeline.press(x - 2 * _AREA, self.at[1]) if down else timeline.release(x - 2 * _AREA)
        elif down:
            self.workspace.input.press(self.at, button, shift=self._shift)
        else:
            self.workspace.input.release(self.at, button, shift=self._shift)

    def shift(self, down: bool) -> None:
        self._shift = down

    def key(self, key: str) -> None:
        self.workspace.input.key(key)

    def write(self, text: str) -> None:
        """Does nothing, since there is no text field without a window."""

    def viewport(self) -> Point:
        return 0.0, 0.0

    def source(self) -> Point:
        return _AREA, 0.0

    def timeline(self) -> Point:
        return 2 * _AREA, 0.0

    def widget(self, name: str) -> Point:
        raise InputError(
            f"there is no window, so {name!r} has no place", where="session", remedy="Use a key."
        )

    def rename(self, name: str) -> bool:
        """Renames the selected shape, since there is no text field."""
        editor = self.workspace.editor
        before = editor.selection.character or ""
        if editor.edit("rename", lambda project: rename_character(project, before, name)):
            editor.select(character=name)
        return True

    def activate(self, name: str) -> bool:
        """Does the same as a click on a widget, for the widgets that a session needs.

        Raises:
            InputError: for an unknown widget.
        """
        kind, _, rest = name.partition(" ")
        mapping = self.workspace.input.tools["map"]
        assert isinstance(mapping, MapTool)
        if kind == "tool":
            self.workspace.input.activate_tool(rest)
        elif kind == "takes":
            pass  # the drop-down list is already open
        elif kind in ("take", "pick"):
            self.workspace.input.activate_tool("map")
            mapping.source.show(rest)
        elif kind == "loop":
            mapping.loop = not mapping.loop
        elif kind == "find":
            mapping.rank()
        elif kind == "whole":
            mapping.map_whole()
        elif kind == "match":
            mapping.accept(mapping.offered[int(rest)])
            mapping.offered = []
        else:
            raise InputError(f"there is no window, so {name!r} cannot be clicked", where="session")
        return True

    def _area(self) -> str:
        return ("viewport", "source", "timeline")[min(int(self.at[0] // (_AREA / 2) + 1) // 2, 2)]
