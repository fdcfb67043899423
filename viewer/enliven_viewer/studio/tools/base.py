"""The base of all tools: a small state machine that the pointer and the keys drive."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from enliven.arrays import Float, Float32, Int32, UInt8
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.viewport import Hit, Overlay, Point, bone_at, joint_at, surface_at

_AS_NEAR = 3.0
"""Pixels: after a cut, two joints are at one place."""


@dataclass(frozen=True)
class Pointer:
    """The pointer's place in the viewport's pixels, and the keys that are held."""

    at: Point
    shift: bool = False
    ctrl: bool = False


@dataclass(frozen=True, eq=False)
class ToolPicture:
    """What a tool draws into the picture, over the meshes.

    Attributes:
        crossing: vertices (V, 3) metres in the world and the faces (K, 3) of them that warn, or None.
        ghost: vertices (V, 3), faces and size, metres, of what is outlined, or None.
        shade: vertices (V, 3) metres in the world, faces, (V, 4) uint8 sRGB and opacity over them; or None.
        tubes: rows of :class:`~enliven_viewer.render.overlay.tubes.Tubes` and their bias, metres.
    """

    crossing: tuple[Float32, Int32] | None = None
    ghost: tuple[Float32, Int32, float] | None = None
    tubes: tuple[tuple[Float32, float], ...] = ()
    shade: tuple[Float | Float32, Int32, UInt8] | None = None


NOTHING = ToolPicture()


class Tool:
    """A tool; it changes the project only through :meth:`Editor.edit`.

    Attributes:
        name: one word, as in sessions.
        label: as on its button.
        key: the letter that makes it the active tool.
        icon: its glyph in Font Awesome 4.
        hint: what to do next, one line.
        plays_on: whether what plays stands still during a drag only, and goes on after it.
    """

    name: ClassVar[str] = ""
    label: ClassVar[str] = ""
    key: ClassVar[str] = ""
    icon: ClassVar[str] = ""
    plays_on: ClassVar[bool] = False

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.hovered: Hit | None = None

    @property
    def hint(self) -> str:
        """What to do next, one line."""
        return ""

    @property
    def warning(self) -> str:
        """What is wrong with the work just now, one line; empty if nothing is."""
        return ""

    def hover(self, pointer: Pointer) -> None:
        """The pointer moved and no button is held."""
        self.hovered = self.handle_at(pointer)

    def press(self, pointer: Pointer) -> bool:
        """Returns the left button went down; False leaves the drag to the camera."""
        return False

    def drag(self, pointer: Pointer) -> None:
        """The pointer moved while the button is held."""

    def release(self, pointer: Pointer) -> None:
        """The button went up."""

    def type(self, key: str) -> bool:
        """Returns a key was pressed; True if the tool took it."""
        return False

    def cancel(self) -> None:
        """Drops what was begun (Escape, or another tool)."""
        self.editor.draft = None

    def overlay(self) -> Overlay:
        """Returns the marks that the tool draws over the viewport."""
        hovered = (self.hovered.character, self.hovered.handle) if self.hovered else None
        return Overlay(chain=self._chosen_chain(), hovered=hovered)

    def picture(self) -> ToolPicture:
        """What the tool draws into the picture."""
        return NOTHING

    def handle_at(self, pointer: Pointer) -> Hit | None:
        """Returns the handle under the pointer, or else the bone; of two as near, the chosen character's."""
        reach, lens, stage = self.editor.settings.reach, self.editor.lens, self.editor.handled
        chosen = [one for one in stage if one.id == self.editor.selection.character]
        for pick, within in ((joint_at, reach), (bone_at, reach * 0.7)):
            hit, mine = pick(stage, lens, pointer.at, within), pick(chosen, lens, pointer.at, within)
            if hit is not None:
                return mine if mine is not None and mine.pixels <= hit.pixels + _AS_NEAR else hit
        return None

    def character_at(self, pointer: Pointer, without: str = "") -> Hit | None:
        """Returns the handle, the bone or the surface of any character under the pointer, but for one's
        surface.
        """
        hit = None if without else self.handle_at(pointer)
        stage = [one for one in self.editor.reachable if one.id != without]
        return hit or surface_at(stage, self.editor.lens, pointer.at)

    def on_bone(self, hit: Hit | None) -> Point | None:
        """Returns the pixel of a place on a bone, while the bone is there."""
        if hit is None or hit.character not in self.editor.project.characters:
            return None
        posed = self.editor.posed(hit.character)
        if hit.handle >= len(posed.handles):
            return None
        pixels = self.editor.lens.pixels_of(posed.on_bone(hit.handle, hit.along)[None])
        return pixels[0] if pixels else None

    def _chosen_chain(self) -> tuple[str, tuple[int, ...]] | None:
        chosen = self.editor.selection
        return (chosen.character, chosen.chain) if chosen.character and chosen.chain else None


class StrokeTool(Tool):
    """A tool that draws a stroke, and takes it when the button goes up."""

    apart: ClassVar[float] = 4.0
    """Pixels between two points of a stroke: finer than a hand draws."""
    plays_on = True

    def __init__(self, editor: Editor) -> None:
        super().__init__(editor)
        self._stroke: list[Point] = []

    def taken(self) -> list[Point]:
        """Returns the points of the stroke, which begins again."""
        stroke, self._stroke = self._stroke, []
        return stroke

    def hover(self, pointer: Pointer) -> None:
        """Nothing is picked while drawing."""

    def press(self, pointer: Pointer) -> bool:
        self.editor.playing = False
        self._stroke = [pointer.at]
        return True

    def drag(self, pointer: Pointer) -> None:
        if self._stroke and math.dist(pointer.at, self._stroke[-1]) >= self.apart:
            self._stroke.append(pointer.at)

    def cancel(self) -> None:
        super().cancel()
        self._stroke = []
