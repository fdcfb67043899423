"""The selection tool: selects characters, a joint, or a chain from one joint to another."""

from __future__ import annotations

import numpy as np

from enliven.document import ExampleCharacter, RiggedCharacter
from enliven_viewer.language import tr
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.viewport.overlay import Fill, Line, Overlay, Point
from enliven_viewer.theme import ACCENT

_MAX_TESTED_VERTICES = 500
"""Maximum number of surface vertices that are tested against a selection box. It is enough to find every
limb.
"""


class SelectTool(Tool):
    """A tool that selects characters and joints. A click selects. Ctrl toggles. Shift adds a character, or
    extends the selection to the chain up to the clicked joint.

    A drag with Ctrl draws a selection box, which selects every character that it touches. Shift adds them to
    the selection.
    """

    name, label, key, icon = "choose", "Choose", "q", "\uf245"

    def __init__(self, editor: Editor) -> None:
        super().__init__(editor)
        self._box: tuple[Point, Point] | None = None

    @property
    def hint(self) -> str:
        """Returns the shortcuts that suit the current selection."""
        chosen = self.editor.selection
        if chosen.has_several:
            return tr(
                "{0} shapes are chosen. Press G and drag one of them to move all of them.",
                len(chosen.characters),
            )
        if chosen.chain:
            return "A chain is chosen. Ctrl+Shift+C copies its motion, Ctrl+Shift+V pastes motion onto it."
        if self.editor.find_selected(ExampleCharacter) is not None:
            return "A puppet is chosen. Press K to add control points and to pose the puppet."
        if chosen.handle is not None:
            return "Shift-click another joint to choose the chain between them. Delete removes the node."
        return "Click a joint or a shape to choose it; Ctrl adds more. Drag empty space to turn the view."

    def press(self, pointer: Pointer) -> bool:
        """Changes the selection by the clicked joint or character, or starts a selection box with Ctrl.

        Returns True only on a joint or for a box. Every other drag turns the view.
        """
        hit, editor = self.character_at(pointer), self.editor
        if hit is None:
            if pointer.ctrl:
                self._box = (pointer.at, pointer.at)
                return True
            editor.select_only(None)
            return False
        shape, start = editor.find_selected(RiggedCharacter), editor.selection.handle
        is_selected, joint = editor.selection.character == hit.character, hit.handle >= 0
        if pointer.ctrl:
            editor.toggle_selected(hit.character)
        elif pointer.shift and not is_selected:
            editor.choose_all(*editor.selection.characters, hit.character)
        elif pointer.shift and joint and shape is not None and start is not None:
            editor.select(chain=shape.skeleton.path(start, hit.handle))
        else:
            editor.select_only(hit.character, hit.handle if joint else None)
        return joint  # Return False for a drag that starts on a surface, because it orbits the camera.

    def drag(self, pointer: Pointer) -> None:
        """Moves the corner of the selection box."""
        if self._box is not None:
            self._box = (self._box[0], pointer.at)

    def release(self, pointer: Pointer) -> None:
        """Selects all characters that the box touches. With Shift, adds them to the selection."""
        box, self._box = self._box, None
        if box is None:
            return
        touched = self._find_boxed_characters(box)
        old_characters = self.editor.selection.characters if pointer.shift else ()
        self.editor.choose_all(*old_characters, *touched)

    def cancel(self) -> None:
        """Drops the selection box."""
        super().cancel()
        self._box = None

    def overlay(self) -> Overlay:
        """Returns the usual marks, with the selection box."""
        base_overlay = super().overlay()
        if self._box is None:
            return base_overlay
        (left, top), (right, bottom) = self._box
        corners = ((left, top), (right, top), (right, bottom), (left, bottom))
        marks = (Fill(corners, (*ACCENT[:3], 0.10)), Line(corners, ACCENT, 1.5, True))
        return Overlay(marks, base_overlay.chain, base_overlay.hovered)

    def _find_boxed_characters(self, box: tuple[Point, Point]) -> list[str]:
        """Returns the characters with a handle or a surface point inside a box of the image."""
        low, high = np.min(box, axis=0), np.max(box, axis=0)
        names = []
        for character in self.editor.pickable_characters:
            surface = character.vertices[:: max(len(character.vertices) // _MAX_TESTED_VERTICES, 1)]
            pixels = self.editor.lens.project(np.concatenate([character.handles, surface]))[0]
            if ((pixels >= low) & (pixels <= high)).all(axis=1).any():
                names.append(character.id)
        return names
