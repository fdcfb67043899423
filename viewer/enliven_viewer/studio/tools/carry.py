"""Carrying a shape about; dropped with its root on another shape's node, the two become one."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Project
from enliven.modeling.edits import merge_characters, move_character
from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.tools.drag import CharacterDrag
from enliven_viewer.studio.viewport import Disc, Hit, Label, Line, Overlay, bone_at, joint_at
from enliven_viewer.theme import GOOD, INK, STROKE


class CarryTool(Tool):
    """Moves a shape parallel to the picture, and merges it where its root comes near a node or a bone."""

    name, label, key, icon = "carry", "Move, merge", "g", "\uf047"

    def __init__(self, editor) -> None:  # type: ignore[no-untyped-def]
        super().__init__(editor)
        self._held: tuple[str, Float, Pointer] | None = None
        self._graft: Hit | None = None
        self._dragged: CharacterDrag | None = None

    @property
    def hint(self) -> str:
        if self._graft is not None:
            return "Let go to merge here; the motions of both are kept."
        if self._dragged is not None:
            return "Let go anywhere; with Shift over another character to make one of the two."
        if self._held is not None:
            return "Bring the red root onto a node of another shape to merge, or let go anywhere."
        if self.editor.selection.puppet is not None:
            return "Drag a puppet to move it; let go with Shift over another to make one of the two."
        return "Drag a shape to move it. Drop its red root on another shape's node to merge the two."

    def press(self, pointer: Pointer) -> bool:
        hit = self.shape_at(pointer)
        if hit is None:
            self._dragged = CharacterDrag.of(self.editor, pointer)
            return self._dragged is not None
        self.editor.select(shape=hit.shape)
        self.editor.select(joint=None, chain=())
        self.editor.playing = False
        posed = self.editor.posed(hit.shape)
        # The root travels in the plane of the picture, whatever it was grabbed by.
        self._held = (hit.shape, posed.joints[0].copy(), pointer)
        return True

    def drag(self, pointer: Pointer) -> None:
        dragged = self._dragged
        if dragged is not None:
            self.editor.sketch(lambda project: dragged.moved(project, pointer))
        if self._held is None:
            return
        shape_id = self._held[0]
        self.editor.sketch(lambda project: self._moved(project, pointer))
        root = self.editor.posed(shape_id).joints[:1]
        pixel = self.editor.lens.project(root)[0][0]
        at, snap = (float(pixel[0]), float(pixel[1])), self.editor.settings.snap
        others = [s for s in self.editor.posed_shapes if s.shape.id != shape_id]
        lens = self.editor.lens
        self._graft = joint_at(others, lens, at, snap) or bone_at(others, lens, at, snap / 2)

    def release(self, pointer: Pointer) -> None:
        mesh, self._dragged = self._dragged, None
        if mesh is not None and self.editor.draft is not None:
            mesh.drop(pointer)
        if self._held is None:
            return
        held, graft, dragged = self._held, self._graft, self.editor.draft is not None
        self._graft = None
        if dragged and graft is not None:
            self._merge(held[0], graft)
        elif dragged:
            self.editor.edit("move", lambda project: self._moved(project, pointer))
        self._held = None

    def cancel(self) -> None:
        super().cancel()
        self._held = self._graft = self._dragged = None

    def overlay(self) -> Overlay:
        plain = super().overlay()
        if self._held is None or self._graft is None:
            return plain
        editor, graft = self.editor, self._graft
        posed = editor.posed(graft.shape)
        parent = max(int(posed.shape.skeleton.parents[graft.joint]), 0)
        place = posed.joints[parent] + graft.along * (posed.joints[graft.joint] - posed.joints[parent])
        points = editor.lens.project(np.stack([place, editor.posed(self._held[0]).joints[0]]))[0]
        node, root = ((float(p[0]), float(p[1])) for p in points)
        return Overlay(
            (
                Line((root, node), STROKE, 2.0),
                Disc(node, 13.0, GOOD, 3.0),
                Label((node[0] + 20, node[1]), "merge", INK),
            ),
            plain.chain,
            plain.hovered,
        )

    def _moved(self, project: Project, pointer: Pointer) -> Project:
        assert self._held is not None
        shape_id, root, start = self._held
        lens = self.editor.lens
        way = lens.on_plane(pointer.at, root) - lens.on_plane(start.at, root)
        return move_character(project, shape_id, way)

    def _merge(self, shape_id: str, graft: Hit) -> None:
        """Merge at the playhead's time: nothing turns then, and both go on moving."""
        time = self.editor.time

        def change(project: Project) -> Project:
            at = graft.along if graft.joint and graft.along < 1.0 else 1.0
            return merge_characters(project, graft.shape, shape_id, time, node=graft.joint, at=at)

        if self.editor.edit(f"merge {shape_id}", change):
            self.editor.select(shape=graft.shape)
            self.editor.toasts.say(f"{shape_id} is now part of {graft.shape}", "Ctrl+Z takes them apart.")
