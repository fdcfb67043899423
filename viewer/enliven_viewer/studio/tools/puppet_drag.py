"""Dragging a control point, from pressing the button to letting it go."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.puppets import Manipulator, StandingPuppet
from enliven_viewer.studio.tools.base import Pointer
from enliven_viewer.studio.viewport import Point


class PointDrag:
    """Drags one control point.

    Attributes:
        point: its number.
        part: of the manipulator that was taken: "x", "xy", "view", ...
        moved: whether it went anywhere.
    """

    def __init__(self, editor: Editor, standing: StandingPuppet, point: int, part: str, at: Point) -> None:
        self.editor, self.point, self.part = editor, point, part
        self._standing, self._start = standing, at
        self._from: Float = np.array(standing.handles[point])
        # As it was when the button went down: the arrows go along with the point, the way is from here.
        self._manipulator = Manipulator(self._from, editor.lens)
        self.moved = False

    def drag(self, pointer: Pointer) -> None:
        """The pointer moved: the surface follows."""
        way = self._manipulator.dragged(self.part, self._start, pointer.at, snap=pointer.shift)
        if way is None or (not self.moved and not way.any()):
            return
        self.moved = True
        self.editor.puppets.drag(self.point, self._standing.into(self._from + way))

    def drop(self) -> None:
        """The button went up: the pose is kept."""
        if self.moved:
            puppet = self._standing.character
            self.editor.puppets.drop(f"pose {puppet.points[self.point].name}")
