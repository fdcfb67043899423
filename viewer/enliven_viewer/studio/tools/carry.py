"""Carrying a character about; dropped with its root on another's node, or by Shift, the two become one."""

from __future__ import annotations

from enliven.document import Project
from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.tools.drag import CharacterDrag
from enliven_viewer.studio.viewport import Disc, Hit, Label, Line, Overlay, bone_at, joint_at
from enliven_viewer.theme import GOOD, INK, STROKE


class CarryTool(Tool):
    """Moves a character parallel to the picture, and merges it where its root comes near a node or a bone."""

    name, label, key, icon = "carry", "Move, merge", "g", "\uf047"

    def __init__(self, editor) -> None:  # type: ignore[no-untyped-def]
        super().__init__(editor)
        self._held: CharacterDrag | None = None
        self._host: Hit | None = None

    @property
    def hint(self) -> str:
        if self._host is not None:
            return "Let go to merge here; the motions of both are kept."
        if self._held is not None and self._held.rooted:
            return "Bring the red root onto a node of another shape to merge, or let go anywhere."
        if self._held is not None:
            return "Let go anywhere; with Shift over another character to make one of the two."
        if self.editor.selection.character is not None and not self._chosen_is_rooted:
            return "Drag it to move it; let go with Shift over another to make one of the two."
        return "Drag a shape to move it. Drop its red root on another shape's node to merge the two."

    @property
    def _chosen_is_rooted(self) -> bool:
        return any(one.id == self.editor.selection.character for one in self.editor.handled)

    def press(self, pointer: Pointer) -> bool:
        hit = self.character_at(pointer)
        self._held = None if hit is None else CharacterDrag(self.editor, hit, pointer)
        if hit is not None:
            self.editor.select(handle=None)
        return hit is not None

    def drag(self, pointer: Pointer) -> None:
        held, editor = self._held, self.editor
        if held is None:
            return
        editor.sketch(lambda project: held.moved(project, pointer))
        pixels = editor.lens.pixels_of(editor.posed(held.character).handles[:1]) if held.rooted else []
        if pixels and not held.several:
            others = [one for one in editor.handled if one.id != held.character]
            lens, at, snap = editor.lens, pixels[0], editor.settings.snap
            self._host = joint_at(others, lens, at, snap) or bone_at(others, lens, at, snap / 2)

    def release(self, pointer: Pointer) -> None:
        """Merge at the playhead's time, where nothing turns then and both go on moving; or let it stand."""
        (held, host), self._held, self._host = (self._held, self._host), None, None
        editor = self.editor
        if held is None or editor.draft is None:
            return
        name, notes = held.character, list[str]()
        if host is None and pointer.shift and not held.several:
            host = self.character_at(pointer, without=name)
        if host is None:
            editor.edit(f"move {held.told}", lambda project: held.moved(project, pointer))
            return
        other = host

        def change(project: Project) -> Project:
            # What snaps to a node is put there by the merge itself.
            moved = project if other.handle >= 0 else held.moved(project, pointer)
            return held.merged(moved, other, notes)

        if editor.edit(f"merge {name}", change):
            editor.choose(other.character)
            editor.toasts.say(f"{name} is now part of {other.character}", "Ctrl+Z takes them apart.")
            for note in notes[:1]:
                editor.toasts.say(note)

    def cancel(self) -> None:
        super().cancel()
        self._held = self._host = None

    def overlay(self) -> Overlay:
        plain, node = super().overlay(), self.on_bone(self._host)
        if self._held is None or node is None:
            return plain
        root = self.editor.lens.pixels_of(self.editor.posed(self._held.character).handles[:1])
        marks = (
            *(Line((at, node), STROKE, 2.0) for at in root),
            Disc(node, 13.0, GOOD, 3.0),
            Label((node[0] + 20, node[1]), "merge", INK),
        )
        return Overlay(marks, plain.chain, plain.hovered)
