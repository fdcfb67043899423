"""The base class of all tools: a small state machine driven by pointer and keys."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.viewport.overlay import EMPTY_PICTURE, Overlay, Point, ToolPicture
from enliven_viewer.studio.viewport.picking import Hit, find_bone_at, find_joint_at, find_surface_at

_DISTANCE_TOLERANCE_PX = 3.0
"""Joints count as equally near if their distances differ by less than this in pixels. After a cut, two joints
coincide.
"""


@dataclass(frozen=True)
class Pointer:
    """The pointer's position in pixels of the viewport, and the held modifier keys.

    Attributes:
        is_finger: True for the press of a finger. It is less precise than a mouse or a pen.
    """

    at: Point
    shift: bool = False
    ctrl: bool = False
    is_finger: bool = False


class Tool:
    """A tool. It changes the project only through :meth:`Editor.edit`.

    Attributes:
        name: one word, as used in scripted sessions.
        label: text of its button.
        key: the shortcut that activates it.
        icon: its glyph in Font Awesome 4.
        hint: one line about the user's next action.
        hides_performer: if True, the performer and the key poses of a puppet are hidden while the tool is
            active.
        plays_on: if True, playback only pauses during a drag and continues afterwards.
    """

    name: ClassVar[str] = ""
    label: ClassVar[str] = ""
    key: ClassVar[str] = ""
    icon: ClassVar[str] = ""
    plays_on: ClassVar[bool] = False
    hides_performer: ClassVar[bool] = False

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.hovered: Hit | None = None

    @property
    def hint(self) -> str:
        """Returns one line about the user's next action."""
        return ""

    @property
    def warning(self) -> str:
        """Returns a one-line warning about the current work, or an empty text if there is none."""
        return ""

    def hover(self, pointer: Pointer) -> None:
        """Handles pointer movement without a pressed button."""
        self.hovered = self.handle_at(pointer)

    def press(self, pointer: Pointer) -> bool:
        """Handles a press of the left button. Returns False if the drag should go to the camera."""
        return False

    def drag(self, pointer: Pointer) -> None:
        """Handles pointer movement with the button held."""

    def release(self, pointer: Pointer) -> None:
        """Handles the release of the button."""

    def type(self, key: str) -> bool:
        """Handles a key press. Returns True if the tool has used it."""
        return False

    def cancel(self) -> None:
        """Cancels the current operation (Escape, or a switch to another tool)."""
        self.editor.draft = None

    def overlay(self) -> Overlay:
        """Returns the marks that the tool draws over the viewport."""
        hovered = (self.hovered.character, self.hovered.handle) if self.hovered else None
        return Overlay(chain=self._find_selected_chain(), hovered=hovered)

    def picture(self) -> ToolPicture:
        """Returns the geometry that the tool draws into the 3D image."""
        return EMPTY_PICTURE

    def handle_at(self, pointer: Pointer) -> Hit | None:
        """Returns the handle under the pointer, or the bone if no handle is there. If two hits are equally
        near, the selected character's is returned.
        """
        reach, lens, stage = self.editor.settings.reach, self.editor.lens, self.editor.editable_characters
        chosen = [character for character in stage if character.id == self.editor.selection.character]
        for pick, within in ((find_joint_at, reach), (find_bone_at, reach * 0.7)):
            hit, chosen_hit = pick(stage, lens, pointer.at, within), pick(chosen, lens, pointer.at, within)
            if hit is not None:
                return (
                    chosen_hit
                    if chosen_hit is not None and chosen_hit.pixels <= hit.pixels + _DISTANCE_TOLERANCE_PX
                    else hit
                )
        return None

    def character_at(self, pointer: Pointer, without: str = "") -> Hit | None:
        """Returns the handle, bone or surface of any character under the pointer.

        The surface of `without` is ignored.
        """
        hit = None if without else self.handle_at(pointer)
        stage = [character for character in self.editor.pickable_characters if character.id != without]
        return hit or find_surface_at(stage, self.editor.lens, pointer.at)

    def on_bone(self, hit: Hit | None) -> Point | None:
        """Returns the pixel of a hit position on a bone, if the bone still exists."""
        if hit is None or hit.character not in self.editor.project.characters:
            return None
        posed = self.editor.stage_character(hit.character)
        if hit.handle >= len(posed.handles):
            return None
        pixels = self.editor.lens.project_visible(posed.on_bone(hit.handle, hit.along)[None])
        return pixels[0] if pixels else None

    def _find_selected_chain(self) -> tuple[str, tuple[int, ...]] | None:
        chosen = self.editor.selection
        return (chosen.character, chosen.chain) if chosen.character and chosen.chain else None


class StrokeTool(Tool):
    """A tool that draws a stroke, and applies it when the button is released."""

    apart: ClassVar[float] = 4.0
    """Minimum distance in pixels between two points of a stroke."""
    plays_on = True

    def __init__(self, editor: Editor) -> None:
        super().__init__(editor)
        self._stroke: list[Point] = []

    def take_points(self) -> list[Point]:
        """Returns the points of the stroke, and clears it."""
        stroke, self._stroke = self._stroke, []
        return stroke

    def hover(self, pointer: Pointer) -> None:
        """Does nothing: hovering picks nothing while drawing."""

    def press(self, pointer: Pointer) -> bool:
        """Pauses playback and starts a stroke. Returns True, so a drag never turns the view."""
        self.editor.playing = False
        self._stroke = [pointer.at]
        return True

    def drag(self, pointer: Pointer) -> None:
        """Appends the pointer's position, if it is at least ``apart`` pixels away from the last point."""
        if self._stroke and math.dist(pointer.at, self._stroke[-1]) >= self.apart:
            self._stroke.append(pointer.at)

    def cancel(self) -> None:
        """Drops the unfinished stroke."""
        super().cancel()
        self._stroke = []
