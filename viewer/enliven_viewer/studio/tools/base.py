"""The base of all tools: a small state machine that the pointer and the keys drive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

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


class Tool:
    """A tool; it changes the project only through :meth:`Editor.edit`.

    Attributes:
        name: one word, as in sessions.
        label: as on its button.
        key: the letter that makes it the active tool.
        icon: its glyph in Font Awesome 4.
        hint: what to do next, one line.
    """

    name: ClassVar[str] = ""
    label: ClassVar[str] = ""
    key: ClassVar[str] = ""
    icon: ClassVar[str] = ""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.hovered: Hit | None = None

    @property
    def hint(self) -> str:
        """What to do next, one line."""
        return ""

    @property
    def warning(self) -> str:
        """What is wrong with the work just now, one line; empty where nothing is."""
        return ""

    def hover(self, pointer: Pointer) -> None:
        """The pointer moved and no button is held."""
        self.hovered = self.handle_at(pointer)

    def press(self, pointer: Pointer) -> bool:
        """The left button went down; False leaves the drag to the camera."""
        return False

    def drag(self, pointer: Pointer) -> None:
        """The pointer moved while the button is held."""

    def release(self, pointer: Pointer) -> None:
        """The button went up."""

    def type(self, key: str) -> bool:
        """A key was pressed; True where the tool took it."""
        return False

    def cancel(self) -> None:
        """Drop what was begun (Escape, or another tool)."""
        self.editor.draft = None

    def overlay(self) -> Overlay:
        """The marks that the tool draws over the viewport."""
        hovered = (self.hovered.shape, self.hovered.joint) if self.hovered else None
        return Overlay(chain=self._chosen_chain(), hovered=hovered)

    def handle_at(self, pointer: Pointer) -> Hit | None:
        """The joint under the pointer, or else the bone; of two as near, the chosen shape's."""
        reach, lens, posed_shapes = self.editor.settings.reach, self.editor.lens, self.editor.posed_shapes
        chosen = [s for s in posed_shapes if s.shape.id == self.editor.selection.shape]
        for pick, within in ((joint_at, reach), (bone_at, reach * 0.7)):
            hit, mine = pick(posed_shapes, lens, pointer.at, within), pick(chosen, lens, pointer.at, within)
            if hit is not None:
                return mine if mine is not None and mine.pixels <= hit.pixels + _AS_NEAR else hit
        return None

    def shape_at(self, pointer: Pointer) -> Hit | None:
        """The joint, the bone or the surface under the pointer."""
        hit = self.handle_at(pointer)
        return hit or surface_at(self.editor.posed_shapes, self.editor.lens, pointer.at)

    def _chosen_chain(self) -> tuple[str, tuple[int, ...]] | None:
        chosen = self.editor.selection
        return (chosen.shape, chosen.chain) if chosen.shape and chosen.chain else None
