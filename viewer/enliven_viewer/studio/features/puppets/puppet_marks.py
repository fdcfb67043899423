"""The drawing of the puppet tool: control points, suggestions and gizmo; and the drag of a control point."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from enliven.arrays import Float, Float32
from enliven_viewer.language import later
from enliven_viewer.render.materials.paint import linear_from_srgb
from enliven_viewer.render.overlay.tubes import make_tube_rows
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.puppets.gizmo import Gizmo
from enliven_viewer.studio.features.puppets.point_suggestions import PointSuggestions
from enliven_viewer.studio.puppets.mesh_cache import find_mesh_centre, find_mesh_normals, measure_mesh
from enliven_viewer.studio.puppets.puppet_editor import PuppetEditor, get_puppet_editor
from enliven_viewer.studio.puppets.puppet_stage import StagePuppet
from enliven_viewer.studio.puppets.symmetry import find_partner_vertex
from enliven_viewer.studio.tools.base import Pointer, ToolPicture
from enliven_viewer.studio.viewport.overlay import Disc, Fill, Label, Line, Point
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.theme import ACCENT, INK, MARK, QUIET, SHADOW, get_point_colour

GHOST_RADIUS = 7.0
"""Radius in pixels of a suggested point's ring. It is larger than a control point."""
POINT_RADIUS = 5.2
"""Radius in pixels of a control point on the mesh."""


def find_suggestion_at(
    standing: StagePuppet, suggested: tuple[int, ...], lens: Lens, pixel: Point
) -> int | None:
    """Returns the suggested vertex with its ring under a pixel, or None."""
    if not suggested:
        return None
    distances = np.linalg.norm(lens.project(standing.vertices[list(suggested)])[0] - pixel, axis=1)
    distances = np.where(np.isfinite(distances), distances, np.inf)
    nearest = int(distances.argmin())
    return suggested[nearest] if distances[nearest] <= GHOST_RADIUS + 2 else None


def make_point_rows(standing: StagePuppet, lens: Lens, chosen: int | None, hovered: int | None) -> Float32:
    """Returns the control points as balls.

    They are (P, 12) rows of :class:`~enliven_viewer.render.overlay.tubes.Tubes`.
    """
    points = standing.handles
    tints = np.array([get_point_colour(k) for k in range(len(points))], float).reshape(-1, 3)
    radii = np.full(len(points), POINT_RADIUS)
    for number, grown in ((hovered, 1.25), (chosen, 1.35)):
        if number is not None and number < len(points):
            radii[number] = POINT_RADIUS * grown
    return make_tube_rows(points, points, radii * lens.pixel_sizes(points), linear_from_srgb(tints))


_DEPTH_BIAS = 0.08
"""Depth bias as a fraction of the camera distance. Control points up to this depth below a surface are
visible.
"""
_GIZMO_DEPTH_BIAS = 0.8
"""Depth bias of the gizmo, large enough that no geometry occludes it."""

Mark = Line | Disc | Fill | Label


class PointDrag:
    """A drag of one control point.

    Attributes:
        point: number of the control point.
        part: grabbed part of the gizmo: "x", "xy", "view", ...
        moved: whether the point has moved.
    """

    def __init__(self, editor: Editor, standing: StagePuppet, point: int, part: str, at: Point) -> None:
        self.editor, self.point, self.part = editor, point, part
        self._standing, self._start = standing, at
        self._start_place: Float = np.array(standing.handles[point])
        # Keep the gizmo of the start of the drag. The drawn arrows follow the point, but its movement is
        # measured from the start position.
        self._manipulator = Gizmo(self._start_place, editor.lens)
        self.moved = False

    def drag(self, pointer: Pointer) -> None:
        """Handles pointer movement: moves the control point and deforms the surface."""
        offset = self._manipulator.drag_offset(self.part, self._start, pointer.at, snap=pointer.shift)
        if offset is None or (not self.moved and not offset.any()):
            return
        self.moved = True
        get_puppet_editor(self.editor).drag(self.point, self._standing.to_mesh(self._start_place + offset))

    def drop(self) -> None:
        """Handles the release of the button: keeps the pose."""
        if self.moved:
            puppet = self._standing.character
            get_puppet_editor(self.editor).drop(later("pose {0}", puppet.points[self.point].name))


class Pointing(Protocol):
    """The state of the puppet tool, as needed for drawing its marks."""

    puppets: PuppetEditor
    suggested: PointSuggestions
    hovered_part: str
    hovered_point: int | None
    hovered_vertex: int | None

    @property
    def held(self) -> PointDrag | None:
        """Returns the current drag of a control point, or None if there is none."""

    def manipulator(self) -> Gizmo | None:
        """Returns the gizmo of the selected control point."""


def make_marks(tool: Pointing, standing: StagePuppet, lens: Lens) -> tuple[Mark, ...]:
    """Returns the marks: suggestions, the ring of the next point, names, and the squares of the gizmo."""
    marks: list[Mark] = []
    if tool.held is None:
        marks += _make_suggestion_marks(tool, standing, lens)
        marks += _make_next_point_marks(tool, standing, lens)
    marks += _make_name_marks(tool, standing, lens)
    manipulator = tool.manipulator()
    if manipulator is not None:
        part = tool.held.part if tool.held is not None else ""
        marks += manipulator.marks(part or tool.hovered_part, part)
    return tuple(marks)


def _make_suggestion_marks(tool: Pointing, standing: StagePuppet, lens: Lens) -> list[Mark]:
    """Returns rings at the ends of limbs.

    They are shown only before any key pose exists, because later they would hide other marks.
    """
    if standing.character.poses or tool.puppets.is_posing:
        return []
    marks: list[Mark] = []
    for vertex in tool.suggested.suggest_vertices(standing.character):
        place = standing.vertices[vertex]
        # Draw rings on the far side fainter.
        seen = (
            standing.direction_to_mesh(lens.view.eye - place)
            @ find_mesh_normals(standing.character.mesh)[vertex]
            > 0.0
        )
        bright, dark = (0.8, 0.35) if seen else (0.3, 0.12)
        white = (*MARK[:3], bright)
        for pixel in lens.project_visible(place[None]):
            marks.append(Disc(pixel, GHOST_RADIUS, (*SHADOW[:3], dark), 3.5))
            marks.append(Disc(pixel, GHOST_RADIUS, white, 1.5))
            marks.append(Disc(pixel, 1.6, white))
    return marks


def _make_next_point_marks(tool: Pointing, standing: StagePuppet, lens: Lens) -> list[Mark]:
    """Returns a ring at the vertex where a click adds a control point, and a ring at its mirror image."""
    if tool.hovered_vertex is None:
        return []
    wanted_vertices = [tool.hovered_vertex]
    if tool.puppets.symmetric:
        other = find_partner_vertex(standing.character, tool.hovered_vertex)
        wanted_vertices += [other] if other is not None and other != tool.hovered_vertex else []
    marks: list[Mark] = []
    for pixel in lens.project_visible(standing.vertices[wanted_vertices]):
        marks.append(Disc(pixel, 6.5, ACCENT, 2.0))
        marks.append(Disc(pixel, 2.0, ACCENT))
    return marks


def _make_name_marks(tool: Pointing, standing: StagePuppet, lens: Lens) -> list[Mark]:
    """Returns the names of the selected and of the hovered control point, and a ring around the selected
    point.
    """
    marks: list[Mark] = []
    chosen, points = tool.puppets.point, standing.character.points
    for number in dict.fromkeys([chosen, tool.hovered_point]):
        if number is None or number >= len(points):
            continue
        for pixel in lens.project_visible(standing.handles[[number]]):
            if number == chosen:
                marks.append(Disc(pixel, POINT_RADIUS * 1.35 + 2.5, (*MARK[:3], 0.9), 1.5))
            point = points[number]
            text_position = (pixel[0] + 16, pixel[1] + 24)
            marks.append(Label(text_position, point.name, INK))
            if point.joint:
                marks.append(Label((text_position[0], text_position[1] + 16), point.joint, QUIET))
    return marks


def make_tool_picture(tool: Pointing, standing: StagePuppet, lens: Lens) -> ToolPicture:
    """Returns the control points, gizmo arrows, outline of another key pose, and self-intersecting faces."""
    puppets, mesh = tool.puppets, standing.character.mesh
    warned, ghost = puppets.self_intersection.faces, puppets.stage.ghost
    mesh_distance = float(np.linalg.norm(standing.to_world(find_mesh_centre(mesh)[None])[0] - lens.view.eye))
    tubes = [
        (
            make_point_rows(standing, lens, puppets.point, tool.hovered_point),
            _DEPTH_BIAS * max(mesh_distance, 0.05),
        )
    ]
    manipulator = tool.manipulator()
    if manipulator is not None:
        part = tool.held.part if tool.held is not None else ""
        gizmo_distance = float(np.linalg.norm(manipulator.place - lens.view.eye))
        tubes.append((manipulator.rows(part or tool.hovered_part, part), _GIZMO_DEPTH_BIAS * gizmo_distance))
    return ToolPicture(
        (standing.solved, mesh.faces[warned]) if puppets.warn and len(warned) else None,
        (ghost.solved, mesh.faces, measure_mesh(mesh)) if ghost is not None else None,
        tuple(tubes),
    )
