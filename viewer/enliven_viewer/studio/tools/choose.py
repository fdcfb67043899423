"""Choosing a character, a joint of it, or a chain from one joint to another."""

from __future__ import annotations

from enliven.document import Shape
from enliven_viewer.studio.tools.base import Pointer, Tool


class ChooseTool(Tool):
    """Click chooses; with Shift, the chain from the chosen joint to the clicked one."""

    name, label, key, icon = "choose", "Choose", "q", "\uf245"

    @property
    def hint(self) -> str:
        chosen = self.editor.selection
        if chosen.chain:
            return "A chain is chosen. Ctrl+Shift+C copies its motion, Ctrl+Shift+V pastes motion onto it."
        if self.editor.puppets.puppet is not None:
            return "A puppet is chosen. K puts control points on it and poses it."
        if chosen.handle is not None:
            return "Shift-click another joint to choose the chain between them. Delete removes the node."
        return "Click a joint or a shape to choose it. Drag empty space to turn the view."

    def press(self, pointer: Pointer) -> bool:
        hit, editor = self.character_at(pointer), self.editor
        if hit is None:
            editor.select(character=None)
            return False
        if hit.handle < 0:
            editor.select(character=hit.character, handle=None, chain=())
            return False
        shape, start = editor.chosen(Shape), editor.selection.handle
        if pointer.shift and shape is not None and shape.id == hit.character and start is not None:
            editor.select(chain=shape.skeleton.path(start, hit.handle))
        else:
            editor.select(character=hit.character, handle=hit.handle, chain=())
        return True
