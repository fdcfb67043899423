"""The puppet tool: control points are put on a mesh by clicking it, and dragged to make key poses."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_viewer.studio.puppets import (
    Manipulator,
    PointSuggestions,
    StandingPuppet,
    ghost_at,
    point_at,
    puppet_at,
    vertex_hit,
)
from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.tools.puppet_drag import PointDrag
from enliven_viewer.studio.tools.puppet_marks import marks_of
from enliven_viewer.studio.viewport import Overlay, Point, possessed_at

_STILL = 4.0
"""Pixels that a click may move."""
_MANY = 1_000_000
"""Faces: where there are more, it is not looked which is under a pointer that only passes."""
_TURN = 0.008
"""Radians a pixel of dragging, as when the stage is dragged."""
_NUDGES: dict[str, tuple[float, float]] = {
    "left": (-1.0, 0.0),
    "right": (1.0, 0.0),
    "up": (0.0, 1.0),
    "down": (0.0, -1.0),
}


class PuppetTool(Tool):
    """Puts, chooses and drags control points of a puppet."""

    name, label, key, icon = "puppet", "Pose puppet", "k", "\uf25a"

    def __init__(self, editor) -> None:  # type: ignore[no-untyped-def]
        super().__init__(editor)
        self.desk = editor.puppets
        self.suggested = PointSuggestions()
        self.over = ""
        self.over_point: int | None = None
        self.over_vertex: int | None = None
        self._grip: PointDrag | None = None
        self._click: Pointer | None = None
        self._last: Point = (0.0, 0.0)
        self._turning = False
        self._fresh: int | None = None

    @property
    def hint(self) -> str:
        desk, puppet = self.desk, self.desk.puppet
        if self._grip is not None:
            return "Let go to keep it; Shift goes in steps, Esc drops it."
        if puppet is None:
            return "Click a puppet. Ctrl+P makes one of the chosen shape, Ctrl+O opens a mesh to make one of."
        if desk.posing:
            name = f"key pose {desk.number + 1}" if desk.number is not None else ""
            return f"Drag control points for {name}. Enter keeps it; R resets a point, Delete removes it."
        if not puppet.points:
            return "Click the mesh where it is to be held: the ends of its limbs, its feet, its head."
        return "Drag a control point to make a key pose of this moment; click the mesh for another one."

    @property
    def warning(self) -> str:
        """What passes through what, while a key pose is edited."""
        return self.desk.crossing.said if self.desk.warn and self.desk.shaping else ""

    @property
    def held(self) -> PointDrag | None:
        """The control point in the hand."""
        return self._grip

    def hover(self, pointer: Pointer) -> None:
        standing = self._standing()
        self.over, self.over_point, self.over_vertex = "", None, None
        if standing is None:
            return
        lens = self.editor.lens
        manipulator = self.manipulator()
        if manipulator is not None:
            self.over = manipulator.at(pointer.at)
        if self.over:
            return
        self.over_point = point_at(standing, lens, pointer.at, self.editor.settings.reach)
        if self.over_point is None and len(standing.puppet.mesh.faces) <= _MANY:
            self.over_vertex = self._vertex_at(standing, pointer)

    def press(self, pointer: Pointer) -> bool:
        self.hover(pointer)
        desk, standing = self.desk, self._standing()
        self._last, self._turning = pointer.at, False
        if standing is not None and self.over and desk.point is not None:
            self._grip = PointDrag(self.editor, standing, desk.point, self.over, pointer.at)
        elif standing is not None and self.over_point is not None:
            self._fresh = None
            desk.choose(standing.puppet.id, self.over_point)
            self._grip = PointDrag(self.editor, standing, self.over_point, "view", pointer.at)
        else:
            self._click = pointer
        self.editor.playing = False
        return True

    def drag(self, pointer: Pointer) -> None:
        if self._grip is not None:
            self._grip.drag(pointer)
        elif self._turning or (self._click is not None and self._far(pointer, self._click)):
            # What began as a click on the mesh, or beside it, turns the view as on the empty stage.
            self._click, self._turning = None, True
            across, down = pointer.at[0] - self._last[0], pointer.at[1] - self._last[1]
            self.editor.camera.orbit(-_TURN * across, _TURN * down)
        self._last = pointer.at

    def release(self, pointer: Pointer) -> None:
        grip, click = self._grip, self._click
        self._grip = self._click = None
        self._turning = False
        if grip is not None:
            grip.drop()
        elif click is not None:
            self._clicked(click)
        self.hover(pointer)

    def type(self, key: str) -> bool:
        desk = self.desk
        if key == "escape":
            return self._step_back()
        if key == "enter" and desk.posing:
            desk.accept()
            return True
        if desk.point is None:
            return False
        if key in ("delete", "backspace"):
            return desk.remove_point() or True
        if key == "r":
            return desk.reset_point() or True
        if key.removeprefix("shift+") in _NUDGES and desk.posing:
            return self._nudge(key.removeprefix("shift+"), 10.0 if key.startswith("shift+") else 1.0)
        return False

    def cancel(self) -> None:
        super().cancel()
        self._grip = self._click = None
        self.desk.let_go()
        self.desk.accept()

    def overlay(self) -> Overlay:
        standing = self._standing()
        if standing is None:
            return Overlay()
        return Overlay(marks_of(self, standing, self.editor.lens))

    def manipulator(self) -> Manipulator | None:
        """At the chosen control point; none while it plays, nor where a click has just put it.

        There it would be in the way of the next click on the mesh.
        """
        standing, point = self._standing(), self.desk.point
        if point == self._fresh and not self.desk.posing:
            return None
        if self.editor.playing or standing is None or point is None or point >= len(standing.points):
            return None
        return Manipulator(standing.points[point], self.editor.lens)

    def _standing(self) -> StandingPuppet | None:
        chosen = self.editor.selection.puppet
        return self.desk.stage.standing_of(chosen) if chosen else None

    def _vertex_at(self, standing: StandingPuppet, pointer: Pointer) -> int | None:
        """The vertex of the chosen puppet under the pointer; a suggested one that is near."""
        lens = self.editor.lens
        ghost = ghost_at(standing, self.suggested.of(standing.puppet), lens, pointer.at)
        if ghost is not None:
            return ghost
        hit = puppet_at(self.desk.standing, lens, pointer.at)
        if hit is None or hit[0] is not standing:
            return None
        place = lens.view.eye + hit[2] * lens.ray(pointer.at)
        return vertex_hit(standing.vertices, standing.puppet.mesh.faces[hit[1]], place)

    def _far(self, pointer: Pointer, start: Pointer) -> bool:
        return float(np.hypot(*np.subtract(pointer.at, start.at))) > _STILL

    def _clicked(self, pointer: Pointer) -> None:
        """A click on the mesh puts a control point; on another puppet it chooses that; beside all, none."""
        standing = self._standing()
        vertex = self._vertex_at(standing, pointer) if standing is not None else None
        if vertex is not None:
            self._fresh = self.desk.point if self.desk.add_point(vertex) else None
            return
        hit = puppet_at(self.desk.standing, self.editor.lens, pointer.at)
        if hit is not None:
            self.desk.accept()
            self.desk.choose(hit[0].puppet.id)
        elif self.desk.point is not None:
            self.editor.select(point=None)
        elif standing is None:
            self._choose_shape(pointer)

    def _choose_shape(self, pointer: Pointer) -> None:
        """Choose the shape or the possessed mesh under the pointer: a puppet can be made of it."""
        shape = self.shape_at(pointer)
        graph = possessed_at(self.editor.possessed, self.editor.lens, pointer.at)
        if shape is not None:
            self.editor.select(shape=shape.shape)
        elif graph is not None:
            self.editor.select(graph=graph[0])

    def _step_back(self) -> bool:
        """Escape: first what is in the hand, then the chosen control point, then the key pose."""
        desk = self.desk
        if self._grip is not None or self._click is not None:
            self._grip = self._click = None
            desk.let_go()
            return True
        if desk.point is not None:
            self.editor.select(point=None)
            return True
        if desk.posing:
            desk.accept()
            return True
        return False

    def _nudge(self, key: str, pixels: float) -> bool:
        manipulator, standing = self.manipulator(), self._standing()
        if manipulator is None or standing is None:
            return False
        lens = self.editor.lens
        right: Float = np.asarray(lens.view.camera_from_world[0, :3])
        across, up = _NUDGES[key]
        way = (across * right + up * lens.up) * pixels * manipulator.pixel
        self.desk.nudge(standing.way_into(way))
        return True
