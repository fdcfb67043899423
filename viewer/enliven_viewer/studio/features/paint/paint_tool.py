"""The brush tool that paints the stiffness of a mesh that performers control."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Float32, UInt8
from enliven.document import Plane, RigBase
from enliven.examples.symmetric import reflect_points
from enliven.meshes import Mesh, barycentric
from enliven.modeling.edits import MAX_DOUBLINGS, Brush, brush_stiffness, paint_character, unpaint_character
from enliven.modeling.mesh.mirror_plane import plane_of_symmetry
from enliven_viewer.language import later, tr
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.viewport.overlay import EMPTY_PICTURE, Disc, Overlay, ToolPicture
from enliven_viewer.studio.viewport.picking import find_surface_at
from enliven_viewer.studio.viewport.stage_character import StageCharacter
from enliven_viewer.theme import FUTURE_POSE, MARK, PAST_POSE, PLAIN_SURFACE, SHADOW, Colour

BRUSHES: dict[Brush, str] = {
    "softer": later("Softer"),
    "stiffer": later("Stiffer"),
    "erase": later("Erase"),
}
"""Brush modes, with the labels of their buttons."""
MIN_RADIUS_PX = 6.0
"""Minimum brush radius in pixels: a few vertices of a detailed mesh."""
MAX_RADIUS_PX = 200.0
"""Maximum brush radius in pixels. The brush then covers about half the width of a large view."""
RADIUS_STEP = 1.25
"""Scale factor of the brush radius for one press of its shortcut."""
_INITIAL_RADIUS_PX = 34.0
"""Initial brush radius in pixels: the width of a limb of a character that fills a third of the view."""
_POINT_SPACING = 0.35
"""Spacing of points along a stroke, as a fraction of the radius, so that the stroke is even."""
_MAX_GAP = 4.0
"""Maximum gap between two points that a stroke fills, as a multiple of the radius. At a wider gap the pointer
has jumped to another part of the mesh.
"""
_UNPAINTED_OPACITY = 0.62
"""Opacity of the overlay on unpainted areas. It hides most of the mesh's colours, but not the shading."""
_FULL_OPACITY = 0.82
"""Opacity of the overlay at full strength."""
_RING_EDGE_OPACITY = 0.45
"""Opacity of the ring's dark edge, which makes the ring visible on meshes of any brightness."""
_MIRRORED_RING_OPACITY = 0.75
"""Opacity of the ring on the mirrored side."""


class PaintTool(Tool):
    """A tool that paints the stiffness of a mesh, on one side or symmetrically.

    Attributes:
        brush: the brush mode.
        radius: brush radius in pixels.
        both_sides: whether strokes are mirrored, if the mesh is symmetric.
    """

    name, label, key, icon = "paint", "Stiff or soft", "d", "\uf1fc"
    hides_performer = True

    def __init__(self, editor: Editor) -> None:
        super().__init__(editor)
        self.brush: Brush = "softer"
        self.radius = _INITIAL_RADIUS_PX
        self.both_sides = False
        self._stroke: list[Float] = []
        self._stroke_brush: Brush = "softer"
        self._radius_m = 0.0
        self._touched_point: tuple[str, Float] | None = None
        self._pointer_position: tuple[float, float] | None = None
        self._planes: tuple[Float, Plane | None] | None = None
        self._preview: tuple[object, int, Float32 | None] | None = None

    @property
    def hint(self) -> str:
        """Returns the effect of the brush, or the reason why the shape cannot be painted."""
        character = self.editor.find_selected()
        if character is None or character.mesh is None:
            return "Click a mesh to paint where it is stiff and where it is soft."
        if character.kind == "bones":
            return (
                "Bones move this shape, so paint has no effect until the shape becomes a possessed character."
            )
        if self.both_sides and self.mirror(character.mesh) is None:
            return "The mesh is not symmetric, so only one side is painted."
        brush_hints = {
            "softer": later("Orange areas are softer: they swing further than the performer moves."),
            "stiffer": later("Blue areas are stiffer."),
            "erase": later("Removes the paint."),
        }
        return tr("{0} Ctrl inverts the brush. The keys [ and ] change its size.", brush_hints[self.brush])

    def mirror(self, mesh: Mesh) -> Plane | None:
        """Returns the symmetry plane of a mesh, or None if it is not symmetric.

        Cached by the identity of the vertex array.
        """
        if self._planes is None or self._planes[0] is not mesh.vertices:
            self._planes = mesh.vertices, plane_of_symmetry(mesh)
        return self._planes[1]

    def resize(self, factor: float) -> None:
        """Multiplies the brush radius by a factor."""
        self.radius = float(np.clip(self.radius * factor, MIN_RADIUS_PX, MAX_RADIUS_PX))

    def clear(self) -> None:
        """Removes all paint from the selected mesh."""
        name = self.editor.selection.character or ""
        self.editor.edit("clear the paint", lambda project: unpaint_character(project, name))

    def describe_missing_paint(self) -> str:
        """Returns the reason why no paint can be cleared, with advice, or an empty text if there is paint."""
        character = self.editor.find_selected()
        if character is None or character.mesh is None or character.mesh.stiffness is None:
            return "The mesh has no paint. Paint with the tool “Stiff or soft”"
        return ""

    def hover(self, pointer: Pointer) -> None:
        """Stores the pixel of the pointer and the touched point, at which the brush's ring is drawn."""
        self._pointer_position, self._touched_point = pointer.at, self._find_touched_point(pointer)

    def press(self, pointer: Pointer) -> bool:
        """Pauses playback and starts a stroke on the touched mesh, which becomes the selected one.

        Returns False outside of all meshes, so that the drag turns the view.
        """
        self.editor.playing, self._pointer_position = False, pointer.at
        touched_point = self._find_touched_point(pointer)
        if touched_point is None:
            return False
        if touched_point[0] != self.editor.selection.character:
            self.editor.select_only(touched_point[0])
        self._stroke, self._touched_point = [touched_point[1]], touched_point
        self._stroke_brush = self._choose_brush(pointer)
        return True

    def drag(self, pointer: Pointer) -> None:
        """Extends the stroke to the touched point. Fills gaps with intermediate points, so that fast strokes
        are solid.

        Across a large gap, such as from a hand to the trunk behind it, no points are added.
        """
        self._pointer_position = pointer.at
        touched_point = self._find_touched_point(pointer, measure=False)
        if not self._stroke or touched_point is None or touched_point[0] != self.editor.selection.character:
            return
        offset = touched_point[1] - self._stroke[-1]
        far, fine = float(np.linalg.norm(offset)), _POINT_SPACING * self._radius_m
        if far >= fine:
            steps = int(np.ceil(far / fine)) if far <= _MAX_GAP * self._radius_m else 1
            last = self._stroke[-1]
            self._stroke += [last + offset * (k + 1) / steps for k in range(steps)]
            self._touched_point = touched_point

    def release(self, pointer: Pointer) -> None:
        """Applies the stroke to the mesh as one edit."""
        stroke, self._stroke = self._stroke, []
        character = self.editor.find_selected()
        if not stroke or character is None or character.mesh is None:
            return
        brush_stroke = np.array(stroke), self._radius_m, self._stroke_brush, self._find_plane(character.mesh)
        step_names = {
            "softer": later("paint softer"),
            "stiffer": later("paint stiffer"),
            "erase": later("erase paint"),
        }
        self.editor.edit(
            step_names[self._stroke_brush],
            lambda project: paint_character(project, character.id, *brush_stroke),
        )

    def cancel(self) -> None:
        """Drops the unfinished stroke."""
        super().cancel()
        self._stroke = []

    def overlay(self) -> Overlay:
        """Returns the ring of the brush in its colour, and a paler ring at the mirrored place."""
        if self._pointer_position is None:
            return Overlay()
        colour = _find_ring_colour(self._stroke_brush if self._stroke else self.brush)
        marks = [
            Disc(self._pointer_position, self.radius, (*SHADOW[:3], _RING_EDGE_OPACITY), 4.0),
            Disc(self._pointer_position, self.radius, colour, 2.0),
        ]
        character = self.editor.find_selected()
        plane = (
            None
            if character is None or character.mesh is None or self._touched_point is None
            else self._find_plane(character.mesh)
        )
        if (
            plane is not None
            and character is not None
            and character.mesh is not None
            and self._touched_point is not None
        ):
            posed = self.editor.stage_character(character.id)
            other = reflect_points(self._touched_point[1], np.asarray(plane.point), np.asarray(plane.normal))
            nearest = int(np.linalg.norm(character.mesh.vertices - other, axis=1).argmin())
            marks += [
                Disc(pixel, self.radius, (*MARK[:3], _MIRRORED_RING_OPACITY), 1.5)
                for pixel in self.editor.lens.project_visible(posed.vertices[[nearest]])
            ]
        return Overlay(tuple(marks))

    def picture(self) -> ToolPicture:
        """Returns the selected mesh in colours: blue for stiff parts, orange for soft parts, else grey."""
        character = self.editor.find_selected()
        if character is None or character.mesh is None:
            return EMPTY_PICTURE
        stiffness = self._find_shown_stiffness(character, character.mesh)
        if stiffness is None:
            stiffness = np.ones(len(character.mesh.vertices), np.float32)
        posed = self.editor.stage_character(character.id)
        seen = posed.solved if posed.solved is not None else posed.vertices
        return ToolPicture(shade=(seen, character.mesh.faces, make_shades(stiffness)))

    def _find_shown_stiffness(self, character: RigBase, mesh: Mesh) -> Float32 | None:
        """Returns the stiffness including the stroke that is being drawn."""
        if not self._stroke:
            return mesh.stiffness
        preview = self._preview
        if preview is None or preview[0] is not mesh or preview[1] != len(self._stroke):
            stiffness = brush_stiffness(
                mesh, np.array(self._stroke), self._radius_m, self._stroke_brush, self._find_plane(mesh)
            )
            preview = self._preview = mesh, len(self._stroke), stiffness
        return preview[2]

    def _find_plane(self, mesh: Mesh) -> Plane | None:
        return self.mirror(mesh) if self.both_sides else None

    def _choose_brush(self, pointer: Pointer) -> Brush:
        """Returns the mode of a stroke. With Ctrl, it is the opposite mode."""
        opposite: dict[Brush, Brush] = {"softer": "stiffer", "stiffer": "softer", "erase": "erase"}
        return opposite[self.brush] if pointer.ctrl else self.brush

    def _find_touched_point(self, pointer: Pointer, *, measure: bool = True) -> tuple[str, Float] | None:
        """Returns the id of the mesh under the pointer, and the touched point (3,) in metres of the rest
        pose. If `measure` is set, also updates the brush size in metres.
        """
        lens = self.editor.lens
        hit = find_surface_at(self.editor.pickable_characters, lens, pointer.at)
        if hit is None:
            return None
        posed = self.editor.stage_character(hit.character)
        mesh = posed.character.mesh
        assert mesh is not None
        place = lens.view.eye + hit.depth * lens.ray(pointer.at)
        if measure:
            self._radius_m = self.radius * float(lens.pixel_sizes(place[None])[0])
        return hit.character, _find_rest_position(posed, mesh, hit.face, place)


def _find_rest_position(posed: StageCharacter, mesh: Mesh, face: int, place: Float) -> Float:
    """Returns the rest position (3,) in metres of a point on a face."""
    face_vertices = mesh.faces[face]
    fraction = barycentric(place[None], posed.vertices[face_vertices][None])[0]
    return np.asarray(fraction @ mesh.vertices[face_vertices])


def _find_ring_colour(brush: Brush) -> Colour:
    """Returns the colour of the ring for the effect of a stroke."""
    if brush == "erase":
        return (*MARK[:3], 0.95)
    return (*(part / 255 for part in (FUTURE_POSE if brush == "softer" else PAST_POSE)), 0.95)


def make_shades(stiffness: Float32) -> UInt8:
    """Returns (V, 4) sRGB and opacity for the stiffness (V,) of vertices: blue above 1, orange below 1, grey
    for 1.
    """
    doublings = np.log2(stiffness) / MAX_DOUBLINGS
    strength = np.minimum(np.abs(doublings), 1.0)[:, None]
    full = np.where(doublings[:, None] > 0, np.array(PAST_POSE), np.array(FUTURE_POSE))
    colours = np.array(PLAIN_SURFACE) + np.sqrt(strength) * (full - np.array(PLAIN_SURFACE))
    opacity = 255 * (_UNPAINTED_OPACITY + (_FULL_OPACITY - _UNPAINTED_OPACITY) * strength)
    return np.concatenate([colours, opacity], 1).astype(np.uint8)
