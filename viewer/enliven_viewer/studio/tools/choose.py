"""Choosing a shape, a joint, or a chain from one joint to another; a possessed mesh; a puppet."""

from __future__ import annotations

from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.tools.drag import mesh_at


class ChooseTool(Tool):
    """Click chooses; with Shift, the chain from the chosen joint to the clicked one."""

    name, label, key, icon = "choose", "Choose", "q", "\uf245"

    @property
    def hint(self) -> str:
        if self.editor.selection.chain:
            return "A chain is chosen. Ctrl+Shift+C copies its motion, Ctrl+Shift+V pastes motion onto it."
        if self.editor.selection.joint is not None:
            return "Shift-click another joint to choose the chain between them. Delete removes the node."
        if self.editor.selection.puppet is not None:
            return "A puppet is chosen. K puts control points on it and poses it."
        return "Click a joint or a shape to choose it. Drag empty space to turn the view."

    def press(self, pointer: Pointer) -> bool:
        hit, editor = self.shape_at(pointer), self.editor
        if self.handle_at(pointer) is None and self._choose_mesh(pointer, hit.depth if hit else float("inf")):
            return False
        if hit is None:
            editor.select(shape=None, graph=None, puppet=None)
            return False
        on_handle = self.handle_at(pointer) is not None
        chosen = editor.selection
        if pointer.shift and on_handle and chosen.shape == hit.shape and chosen.joint is not None:
            skeleton = editor.project.shapes[hit.shape].skeleton
            editor.select(chain=skeleton.path(chosen.joint, hit.joint))
            return True
        editor.select(shape=hit.shape)
        editor.select(joint=hit.joint if on_handle else None, chain=())
        return on_handle

    def _choose_mesh(self, pointer: Pointer, depth: float) -> bool:
        """Choose a possessed mesh or a puppet that is nearer than ``depth`` metres; whether there is one."""
        mesh = mesh_at(self.editor, pointer)
        if mesh is None or mesh[1] >= depth:
            return False
        self.editor.choose(mesh[0])
        return True
