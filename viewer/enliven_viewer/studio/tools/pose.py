"""Posing: a handle is dragged and what it moves follows; the root, or the surface, turns the whole."""

from __future__ import annotations

from enliven.document import Project
from enliven.modeling.edits import drag_handle
from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.tools.drag import CharacterDrag


class PoseTool(Tool):
    """Drags one handle; dragged by the root, or by its surface, the character turns where it stands."""

    name, label, key, icon = "pose", "Pose", "r", "\uf183"

    def __init__(self, editor) -> None:  # type: ignore[no-untyped-def]
        super().__init__(editor)
        self._held: tuple[CharacterDrag, int] | None = None

    @property
    def hint(self) -> str:
        if self._held is not None:
            return "Let go to keep it so; Esc drops it."
        if self.editor.puppets.puppet is not None:
            return "Drag a puppet sideways to turn it where it stands. K poses it."
        return "Drag a joint to turn its bone, the root to turn the whole; with Shift about the upright."

    def press(self, pointer: Pointer) -> bool:
        hit = self.character_at(pointer)
        self._held = None if hit is None else (CharacterDrag(self.editor, hit, pointer), max(hit.handle, 0))
        return hit is not None

    def drag(self, pointer: Pointer) -> None:
        if self._held is not None:
            self.editor.sketch(lambda project: self._posed(project, pointer))

    def release(self, pointer: Pointer) -> None:
        if self._held is not None and self.editor.draft is not None:
            whole, handle = self._held
            name = f"pose {whole.character}" if handle else f"turn {whole.told}"
            self.editor.edit(name, lambda p: self._posed(p, pointer))
        self._held = None

    def cancel(self) -> None:
        super().cancel()
        self._held = None

    def _posed(self, project: Project, pointer: Pointer) -> Project:
        assert self._held is not None
        (whole, handle), editor = self._held, self.editor
        if not handle:
            return whole.turned(project, pointer)
        before = whole.handles[handle]
        return drag_handle(
            project, whole.character, handle, editor.lens.on_plane(pointer.at, before), editor.time
        )
