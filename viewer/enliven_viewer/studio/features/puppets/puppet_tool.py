"""The puppet tool. A click on a mesh adds a control point, and dragging control points makes key poses."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_viewer.language import tr
from enliven_viewer.render.camera import TURN_PER_PIXEL
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.puppets.gizmo import Gizmo
from enliven_viewer.studio.features.puppets.point_suggestions import PointSuggestions
from enliven_viewer.studio.features.puppets.puppet_marks import (
    PointDrag,
    find_suggestion_at,
    make_marks,
    make_tool_picture,
)
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.puppets.puppet_stage import StagePuppet
from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.viewport.overlay import EMPTY_PICTURE, Overlay, Point, ToolPicture
from enliven_viewer.studio.viewport.picking import find_joint_at, find_surface_at
from enliven_viewer.studio.viewport.ray import find_hit_vertex

_MAX_CLICK_MOVEMENT_PX = 4.0
"""Maximum pointer movement of a click, in pixels."""
_MAX_HOVER_FACES = 1_000_000
"""Maximum number of faces of a mesh in which the hovered vertex is searched. The search would be slow for
larger meshes.
"""
_NUDGE_STEPS: dict[str, tuple[float, float]] = {
    "left": (-1.0, 0.0),
    "right": (1.0, 0.0),
    "up": (0.0, 1.0),
    "down": (0.0, -1.0),
}
"""Steps to the right and up for each arrow key, in pixels of the view."""


class PuppetTool(Tool):
    """Adds, selects and drags control points of a puppet."""

    name, label, key, icon = "puppet", "Pose puppet", "k", "\uf25a"

    def __init__(self, editor: Editor) -> None:
        super().__init__(editor)
        self.puppets = get_puppet_editor(editor)
        self.suggested = PointSuggestions()
        self.hovered_part = ""
        self.hovered_point: int | None = None
        self.hovered_vertex: int | None = None
        self._drag: PointDrag | None = None
        self._click: Pointer | None = None
        self._last_pixel: Point = (0.0, 0.0)
        self._is_turning_view = False
        self._new_point: int | None = None

    @property
    def hint(self) -> str:
        """Returns the next step: make a puppet, add control points, or drag them for a key pose."""
        puppets, puppet = self.puppets, self.puppets.puppet
        if self._drag is not None:
            return "Release to keep the change. Shift moves in steps, Esc cancels."
        if puppet is None:
            return "Click a puppet. Ctrl+P makes one from the chosen shape, Ctrl+O opens a mesh as one."
        if puppets.is_posing:
            name = tr("key pose {0}", puppets.number + 1) if puppets.number is not None else ""
            return tr(
                "Drag control points for {0}. Enter keeps the pose. R resets a point, Delete removes a "
                "point.",
                name,
            )
        if not puppet.points:
            return (
                "Click the mesh to put control points where you want to drag it: ends of limbs, feet, head."
            )
        return (
            "Drag a control point to make a key pose for this moment. Click the mesh to add a control point."
        )

    @property
    def warning(self) -> str:
        """Returns a line about self-intersecting parts while a key pose is edited, otherwise an
        empty text.
        """
        return self.puppets.self_intersection.message if self.puppets.warn and self.puppets.is_shaping else ""

    @property
    def held(self) -> PointDrag | None:
        """Returns the current drag of a control point, or None if there is none."""
        return self._drag

    def hover(self, pointer: Pointer) -> None:
        """Finds the part of the gizmo under the pointer, otherwise the control point, otherwise the vertex.

        On large meshes no vertex is searched, because that would take too long for each movement.
        """
        standing = self.puppets.stage_puppet
        self.hovered_part, self.hovered_point, self.hovered_vertex = "", None, None
        if standing is None:
            return
        lens = self.editor.lens
        manipulator = self.manipulator()
        if manipulator is not None:
            self.hovered_part = manipulator.find_part(pointer.at)
        if self.hovered_part:
            return
        hit = find_joint_at([standing], lens, pointer.at, self.editor.settings.reach)
        if hit is None and pointer.is_finger and manipulator is not None:
            # Nothing is exactly below the finger. So it grabs the nearest part of the gizmo.
            self.hovered_part = manipulator.find_nearest_part(pointer.at)
            if self.hovered_part:
                return
        self.hovered_point = None if hit is None else hit.handle
        if hit is None and len(standing.character.mesh.faces) <= _MAX_HOVER_FACES:
            self.hovered_vertex = self._vertex_at(standing, pointer)

    def press(self, pointer: Pointer) -> bool:
        """Starts a drag of the gizmo or of a control point. Elsewhere, only the release decides if it was a
        click.
        """
        self.hover(pointer)
        puppets, standing = self.puppets, self.puppets.stage_puppet
        self._last_pixel, self._is_turning_view = pointer.at, False
        if standing is not None and self.hovered_part and puppets.point is not None:
            self._drag = PointDrag(self.editor, standing, puppets.point, self.hovered_part, pointer.at)
        elif standing is not None and self.hovered_point is not None:
            self._new_point = None
            self.editor.select_only(standing.id, self.hovered_point)
            self._drag = PointDrag(self.editor, standing, self.hovered_point, "view", pointer.at)
        else:
            self._click = pointer
        self.editor.playing = False
        return True

    def drag(self, pointer: Pointer) -> None:
        """Moves the dragged control point. If no point is dragged, turns the view."""
        if self._drag is not None:
            self._drag.drag(pointer)
        elif self._is_turning_view or (self._click is not None and self._is_drag(pointer, self._click)):
            # A drag that begins on or next to the mesh orbits the camera, as in an empty scene.
            self._click, self._is_turning_view = None, True
            across, down = pointer.at[0] - self._last_pixel[0], pointer.at[1] - self._last_pixel[1]
            self.editor.camera.orbit(-TURN_PER_PIXEL * across, TURN_PER_PIXEL * down)
        self._last_pixel = pointer.at

    def release(self, pointer: Pointer) -> None:
        """Ends the drag as one edit. A click adds a control point, selects another puppet or deselects the
        point.
        """
        drag, click = self._drag, self._click
        self._drag = self._click = None
        self._is_turning_view = False
        if drag is not None:
            drag.drop()
        elif click is not None:
            self._handle_click(click)
        self.hover(pointer)

    def type(self, key: str) -> bool:
        """Handles Escape, Enter (keeps the pose), Delete, R (resets the point) and the arrow keys.

        Arrow keys move the control point in small steps, with Shift in steps that are ten times as large.
        """
        puppets = self.puppets
        if key == "escape":
            return self._step_back()
        if key == "enter" and puppets.is_posing:
            puppets.accept()
            return True
        if puppets.point is None:
            return False
        if key in ("delete", "backspace"):
            return puppets.remove_point() or True
        if key == "r":
            return puppets.reset_point() or True
        if key.removeprefix("shift+") in _NUDGE_STEPS and puppets.is_posing:
            return self._nudge(key.removeprefix("shift+"), 10.0 if key.startswith("shift+") else 1.0)
        return False

    def cancel(self) -> None:
        """Cancels a drag, and keeps the key pose that is being edited."""
        super().cancel()
        self._drag = self._click = None
        self.puppets.clear_drag()
        self.puppets.accept()

    def overlay(self) -> Overlay:
        """Returns the marks of the control points and of the gizmo."""
        standing = self.puppets.stage_puppet
        if standing is None:
            return Overlay()
        return Overlay(make_marks(self, standing, self.editor.lens))

    def picture(self) -> ToolPicture:
        """Returns the geometry for editing the chosen puppet, or nothing if no puppet is chosen."""
        standing = self.puppets.stage_puppet
        return EMPTY_PICTURE if standing is None else make_tool_picture(self, standing, self.editor.lens)

    def manipulator(self) -> Gizmo | None:
        """Returns the gizmo at the selected control point.

        Returns None during playback, or right after a point was added.

        Right after a click, the gizmo could intercept the next click on the mesh.
        """
        standing, point = self.puppets.stage_puppet, self.puppets.point
        if point == self._new_point and not self.puppets.is_posing:
            return None
        if self.editor.playing or standing is None or point is None or point >= len(standing.handles):
            return None
        return Gizmo(standing.handles[point], self.editor.lens)

    def _vertex_at(self, standing: StagePuppet, pointer: Pointer) -> int | None:
        """Returns the vertex of the selected puppet under the pointer, snapped to a suggested
        vertex nearby.
        """
        lens = self.editor.lens
        ghost = find_suggestion_at(
            standing, self.suggested.suggest_vertices(standing.character), lens, pointer.at
        )
        if ghost is not None:
            return ghost
        hit = find_surface_at(self.puppets.stage_puppets, lens, pointer.at)
        if hit is None or hit.character != standing.id:
            return None
        place = lens.view.eye + hit.depth * lens.ray(pointer.at)
        return find_hit_vertex(standing.vertices, standing.character.mesh.faces[hit.face], place)

    def _is_drag(self, pointer: Pointer, start: Pointer) -> bool:
        return float(np.hypot(*np.subtract(pointer.at, start.at))) > _MAX_CLICK_MOVEMENT_PX

    def _handle_click(self, pointer: Pointer) -> None:
        """Handles a click: adds a control point, selects another puppet, or deselects the control point."""
        standing = self.puppets.stage_puppet
        vertex = self._vertex_at(standing, pointer) if standing is not None else None
        if vertex is not None:
            self._new_point = self.puppets.point if self.puppets.add_point(vertex) else None
            return
        hit = find_surface_at(
            [character for character in self.editor.pickable_characters if character.has_own_tool],
            self.editor.lens,
            pointer.at,
        )
        if hit is not None:
            self.puppets.accept()
        elif self.puppets.point is not None:
            self.editor.select(handle=None)
        elif standing is None:
            # The artist can make a puppet of the character under the pointer.
            hit = self.character_at(pointer)
        if hit is not None:
            self.editor.select_only(hit.character)

    def _step_back(self) -> bool:
        """Handles Escape, one step at a time.

        It first cancels the drag, then deselects the control point, then leaves the key pose.
        """
        puppets = self.puppets
        if self._drag is not None or self._click is not None:
            self._drag = self._click = None
            puppets.clear_drag()
            return True
        if puppets.point is not None:
            self.editor.select(handle=None)
            return True
        if puppets.is_posing:
            puppets.accept()
            return True
        return False

    def _nudge(self, key: str, pixels: float) -> bool:
        manipulator, standing = self.manipulator(), self.puppets.stage_puppet
        if manipulator is None or standing is None:
            return False
        lens = self.editor.lens
        right: Float = np.asarray(lens.view.camera_from_world[0, :3])
        across, up = _NUDGE_STEPS[key]
        offset = (across * right + up * lens.up) * pixels * manipulator.pixel
        self.puppets.nudge(standing.direction_to_mesh(offset))
        return True
