"""Painting stiff and soft spots: a brush over the surface of a mesh that performers hold."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Float32, UInt8
from enliven.document import Plane, RigBase
from enliven.examples import reflected
from enliven.meshes import Mesh, barycentric
from enliven.modeling.edits import MOST_DOUBLINGS, Brush, brushed, paint_character, unpaint_character
from enliven.modeling.mesh import plane_of_symmetry
from enliven_viewer.language import later, tr
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.tools.base import NOTHING, Pointer, Tool, ToolPicture
from enliven_viewer.studio.viewport import Disc, Overlay, StandingCharacter, surface_at
from enliven_viewer.theme import AFTER, BEFORE, MARK, PLAIN_SURFACE, SHADOW, Colour

BRUSHES: dict[Brush, str] = {
    "softer": later("Softer"),
    "stiffer": later("Stiffer"),
    "erase": later("As it was"),
}
"""What strokes do, by the words on the buttons."""
SMALLEST = 6.0
"""Pixels of the brush's radius at least: a few vertices of a detailed mesh."""
LARGEST = 200.0
"""Pixels of the radius at most: half of a large picture's width is covered then."""
STEP = 1.25
"""By how much a key makes the brush larger or smaller."""
_FIRST = 34.0
"""Pixels of the radius at the beginning: the width of a limb that fills a third of the picture."""
_DENSE = 0.35
"""Of the radius: places of a stroke are so near to one another that it is even along its way."""
_LEAP = 4.0
"""Of the radius: over a wider gap the stroke went from one part of the mesh to another."""
_WASH = 0.62
"""Opacity over what is not painted: the light on it is seen through, its colours hardly."""
_FULL = 0.82
"""Opacity where a spot is strongest."""
_RING_EDGE = 0.45
"""Opacity of the ring's edge, which shows it on meshes of any brightness."""
_OTHER_SIDE = 0.75
"""Opacity of the ring where the other side is painted."""


class PaintTool(Tool):
    """Paints where a mesh bends less and where it gives way, on one side or on both alike.

    Attributes:
        brush: what a stroke does.
        radius: pixels of the brush.
        both_sides: whether the mirror image of a stroke is painted too, where the mesh has one.
    """

    name, label, key, icon = "paint", "Stiff or soft", "d", "\uf1fc"

    def __init__(self, editor: Editor) -> None:
        super().__init__(editor)
        self.brush: Brush = "softer"
        self.radius = _FIRST
        self.both_sides = False
        self._stroke: list[Float] = []
        self._now: Brush = "softer"
        self._metres = 0.0
        self._over: tuple[str, Float] | None = None
        self._at: tuple[float, float] | None = None
        self._planes: tuple[Float, Plane | None] | None = None
        self._preview: tuple[object, int, Float32 | None] | None = None

    @property
    def hint(self) -> str:
        one = self.editor.chosen()
        if one is None or one.mesh is None:
            return "Click a mesh to paint where it is stiff and where it is soft."
        if one.kind == "bones":
            return "Its bones move it, so paint has no effect before it becomes a mesh that performers hold."
        if self.both_sides and self.mirror(one.mesh) is None:
            return "Its sides are not alike, so only where you paint is painted."
        words = {
            "softer": "Orange gives way, and swings past what the performer does.",
            "stiffer": "Blue keeps its shape.",
            "erase": "Brings back what the mesh was before.",
        }
        return tr("{0} Ctrl does the opposite; the keys [ and ] size the brush.", words[self.brush])

    def mirror(self, mesh: Mesh) -> Plane | None:
        """Returns the plane between left and right of a mesh, known by its vertices; None if it has none."""
        if self._planes is None or self._planes[0] is not mesh.vertices:
            self._planes = mesh.vertices, plane_of_symmetry(mesh)
        return self._planes[1]

    def resize(self, factor: float) -> None:
        """Makes the brush larger or smaller."""
        self.radius = float(np.clip(self.radius * factor, SMALLEST, LARGEST))

    def clear(self) -> None:
        """Takes all paint off the chosen mesh."""
        name = self.editor.selection.character or ""
        self.editor.edit("clear the paint", lambda project: unpaint_character(project, name))

    def lacks_paint(self) -> str:
        """Returns why there is no paint to be cleared, and what to do about it; empty if there is."""
        one = self.editor.chosen()
        if one is None or one.mesh is None or one.mesh.stiffness is None:
            return "Nothing is painted on it. Paint with the brush of the tool Stiff or soft"
        return ""

    def hover(self, pointer: Pointer) -> None:
        self._at, self._over = pointer.at, self._touched(pointer)

    def press(self, pointer: Pointer) -> bool:
        self.editor.playing, self._at = False, pointer.at
        over = self._touched(pointer)
        if over is None:
            return False
        if over[0] != self.editor.selection.character:
            self.editor.choose(over[0])
        self._stroke, self._over = [over[1]], over
        self._now = self._brush_of(pointer)
        return True

    def drag(self, pointer: Pointer) -> None:
        self._at = pointer.at
        over = self._touched(pointer, measure=False)
        if not self._stroke or over is None or over[0] != self.editor.selection.character:
            return
        way = over[1] - self._stroke[-1]
        far, fine = float(np.linalg.norm(way)), _DENSE * self._metres
        if far >= fine:
            steps = int(np.ceil(far / fine)) if far <= _LEAP * self._metres else 1
            last = self._stroke[-1]
            self._stroke += [last + way * (k + 1) / steps for k in range(steps)]
            self._over = over

    def release(self, pointer: Pointer) -> None:
        stroke, self._stroke = self._stroke, []
        one = self.editor.chosen()
        if not stroke or one is None or one.mesh is None:
            return
        told = np.array(stroke), self._metres, self._now, self._plane(one.mesh)
        said = {
            "softer": later("paint softer"),
            "stiffer": later("paint stiffer"),
            "erase": later("erase paint"),
        }
        self.editor.edit(said[self._now], lambda project: paint_character(project, one.id, *told))

    def cancel(self) -> None:
        super().cancel()
        self._stroke = []

    def overlay(self) -> Overlay:
        if self._at is None:
            return Overlay()
        colour = _ring(self._now if self._stroke else self.brush)
        marks = [
            Disc(self._at, self.radius, (*SHADOW[:3], _RING_EDGE), 4.0),
            Disc(self._at, self.radius, colour, 2.0),
        ]
        one = self.editor.chosen()
        plane = None if one is None or one.mesh is None or self._over is None else self._plane(one.mesh)
        if plane is not None and one is not None and one.mesh is not None and self._over is not None:
            posed = self.editor.posed(one.id)
            other = reflected(self._over[1], np.asarray(plane.point), np.asarray(plane.normal))
            nearest = int(np.linalg.norm(one.mesh.vertices - other, axis=1).argmin())
            marks += [
                Disc(at, self.radius, (*MARK[:3], _OTHER_SIDE), 1.5)
                for at in self.editor.lens.pixels_of(posed.vertices[[nearest]])
            ]
        return Overlay(tuple(marks))

    def picture(self) -> ToolPicture:
        one = self.editor.chosen()
        if one is None or one.mesh is None:
            return NOTHING
        stiffness = self._shown(one, one.mesh)
        if stiffness is None:
            stiffness = np.ones(len(one.mesh.vertices), np.float32)
        posed = self.editor.posed(one.id)
        seen = posed.solved if posed.solved is not None else posed.vertices
        return ToolPicture(shade=(seen, one.mesh.faces, shades(stiffness)))

    def _shown(self, one: RigBase, mesh: Mesh) -> Float32 | None:
        """Returns the stiffness as it would be after the stroke that is being drawn."""
        if not self._stroke:
            return mesh.stiffness
        known = self._preview
        if known is None or known[0] is not mesh or known[1] != len(self._stroke):
            made = brushed(mesh, np.array(self._stroke), self._metres, self._now, self._plane(mesh))
            known = self._preview = mesh, len(self._stroke), made
        return known[2]

    def _plane(self, mesh: Mesh) -> Plane | None:
        return self.mirror(mesh) if self.both_sides else None

    def _brush_of(self, pointer: Pointer) -> Brush:
        """What a stroke does; with Ctrl the opposite."""
        opposite: dict[Brush, Brush] = {"softer": "stiffer", "stiffer": "softer", "erase": "erase"}
        return opposite[self.brush] if pointer.ctrl else self.brush

    def _touched(self, pointer: Pointer, *, measure: bool = True) -> tuple[str, Float] | None:
        """Returns the mesh under the pointer, and the place on it at rest, metres; it measures the brush
        there.
        """
        lens = self.editor.lens
        hit = surface_at(self.editor.reachable, lens, pointer.at)
        if hit is None:
            return None
        posed = self.editor.posed(hit.character)
        mesh = posed.character.mesh
        assert mesh is not None
        place = lens.view.eye + hit.depth * lens.ray(pointer.at)
        if measure:
            self._metres = self.radius * float(lens.spans(place[None])[0])
        return hit.character, _at_rest(posed, mesh, hit.face, place)


def _at_rest(posed: StandingCharacter, mesh: Mesh, face: int, place: Float) -> Float:
    """Returns (3,) metres, where a place on a face is at rest."""
    own = mesh.faces[face]
    share = barycentric(place[None], posed.vertices[own][None])[0]
    return np.asarray(share @ mesh.vertices[own])


def _ring(brush: Brush) -> Colour:
    """Returns the colour of the ring, by the effect of a stroke."""
    if brush == "erase":
        return (*MARK[:3], 0.95)
    return (*(part / 255 for part in (AFTER if brush == "softer" else BEFORE)), 0.95)


def shades(stiffness: Float32) -> UInt8:
    """Returns (V, 4) sRGB and opacity: blue where it is stiffer, orange where it is softer, grey where it is
    1.
    """
    doublings = np.log2(stiffness) / MOST_DOUBLINGS
    strength = np.minimum(np.abs(doublings), 1.0)[:, None]
    full = np.where(doublings[:, None] > 0, np.array(BEFORE), np.array(AFTER))
    colours = np.array(PLAIN_SURFACE) + np.sqrt(strength) * (full - np.array(PLAIN_SURFACE))
    opacity = 255 * (_WASH + (_FULL - _WASH) * strength)
    return np.concatenate([colours, opacity], 1).astype(np.uint8)
