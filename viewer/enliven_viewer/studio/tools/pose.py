"""Posing: a joint is dragged, and its bone turns about its parent; the root turns the whole shape."""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Float
from enliven.document import Project
from enliven.modeling.rigged import drag_joint, turn_bone
from enliven.rotation import from_rotation_vector
from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.tools.drag import CharacterDrag
from enliven_viewer.studio.viewport import PosedShape

_TURN = 0.01
"""Radians a pixel."""
_UPRIGHT = np.array([0.0, 1.0, 0.0])


class PoseTool(Tool):
    """Turns one bone; dragged by the root, or by its surface, the shape turns in the picture's plane."""

    name, label, key, icon = "pose", "Pose", "r", "\uf183"

    def __init__(self, editor) -> None:  # type: ignore[no-untyped-def]
        super().__init__(editor)
        self._held: tuple[PosedShape, int, Pointer] | None = None
        self._puppet: CharacterDrag | None = None

    @property
    def hint(self) -> str:
        if self._puppet is not None:
            return "Let go to keep it so; Esc drops it."
        if self._held is not None:
            return "Let go to keep the pose; Esc drops it."
        if self.editor.selection.puppet is not None:
            return "Drag a puppet sideways to turn it where it stands. K poses it."
        return "Drag a joint to turn its bone, the root to turn the whole; with Shift about the upright."

    def press(self, pointer: Pointer) -> bool:
        hit = self.shape_at(pointer)
        if hit is None:
            self._puppet = CharacterDrag.of(self.editor, pointer)
            return self._puppet is not None
        on_handle = self.handle_at(pointer) is not None
        joint = hit.joint if on_handle else 0
        self.editor.select(shape=hit.shape)
        self.editor.select(joint=joint, chain=())
        self.editor.playing = False
        self._held = (self.editor.posed(hit.shape), joint, pointer)
        return True

    def drag(self, pointer: Pointer) -> None:
        if self._puppet is not None:
            held = self._puppet
            self.editor.sketch(lambda project: held.turned(project, pointer))
        if self._held is not None:
            self.editor.sketch(lambda project: self._posed(project, pointer))

    def release(self, pointer: Pointer) -> None:
        puppet, self._puppet = self._puppet, None
        if puppet is not None and self.editor.draft is not None:
            self.editor.edit(f"turn {puppet.character}", lambda project: puppet.turned(project, pointer))
        if self._held is None:
            return
        if self.editor.draft is not None:
            self.editor.edit("pose", lambda project: self._posed(project, pointer))
        self._held = None

    def cancel(self) -> None:
        super().cancel()
        self._held = self._puppet = None

    def _posed(self, project: Project, pointer: Pointer) -> Project:
        assert self._held is not None
        posed, joint, start = self._held
        shape, time = posed.shape.id, self.editor.time
        if joint:
            point = self.editor.lens.on_plane(pointer.at, posed.joints[joint])
            return drag_joint(project, shape, joint, point, time)
        return turn_bone(project, shape, 0, self._turn_of_all(posed, start, pointer), time)

    def _turn_of_all(self, posed: PosedShape, start: Pointer, pointer: Pointer) -> Float:
        """(4,) the world turn about the view's axis by as much as the pointer went around the root."""
        lens = self.editor.lens
        if pointer.shift:
            return from_rotation_vector(_UPRIGHT * (_TURN * (pointer.at[0] - start.at[0])))
        centre = lens.project(posed.joints[:1])[0][0]
        before, after = (np.array(p.at) - centre for p in (start, pointer))
        if np.linalg.norm(before) < 24:
            angle = _TURN * float(pointer.at[0] - start.at[0])
        else:
            angle = math.atan2(after[1], after[0]) - math.atan2(before[1], before[0])
        return from_rotation_vector(lens.forward * angle)
