"""The tool that marks a performer's head, hands and feet on a possessed mesh."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import scipy

from enliven.arrays import Float, Int
from enliven.document import GraphCharacter, Project
from enliven.errors import EnlivenError
from enliven.meshes import Mesh
from enliven.person import Joint
from enliven.possession import find_person_in_mesh, make_standing_figure
from enliven_viewer.language import later, tr
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.viewport.overlay import Disc, Label, Overlay, Point
from enliven_viewer.studio.viewport.picking import find_surface_at
from enliven_viewer.studio.viewport.ray import find_hit_vertex
from enliven_viewer.theme import ACCENT, MARK, QUIET

_END_WORDS = (later("head"), later("left hand"), later("right hand"), later("left foot"), later("right foot"))
"""Names of the limb ends within a sentence."""
END_NAMES = (later("Head"), later("Left hand"), later("Right hand"), later("Left foot"), later("Right foot"))
"""Labels of the limb ends, in the order of their numbers."""
_FIGURE_JOINTS = [Joint.HEAD, Joint.HAND_LEFT, Joint.HAND_RIGHT, Joint.FOOT_LEFT, Joint.FOOT_RIGHT]
_MARK_RADIUS_PX = 8.0
"""Radius of a mark in pixels."""
_LABEL_OFFSET_PX = (14.0, 0.0)
"""Offset in pixels from a mark to its label."""


class LimbEndsTool(Tool):
    """A tool that drags the marks of head, hands and feet over the surface of the selected possessed mesh."""

    name, label, key, icon = "ends", "Name ends", "e", "\uf007"

    def __init__(self, editor: Editor) -> None:
        super().__init__(editor)
        self._threads: ThreadPoolExecutor | None = None
        self._mesh: Mesh | None = None
        self._search: Future[Int] | None = None
        self._held_mark: tuple[int, int] | None = None

    @property
    def hint(self) -> str:
        """Returns the next step: choose a character, or drag one of its marks."""
        shape = self.editor.find_selected(GraphCharacter)
        if shape is None:
            return "Click a possessed character to mark its head, hands and feet."
        if self._held_mark is not None:
            return tr(
                "Release where the performer's {0} should be. Esc cancels.", _END_WORDS[self._held_mark[0]]
            )
        if len(shape.ends):
            return (
                "These marks pair the character's limbs with yours. Drag a mark to move it. Delete "
                "detects all marks again."
            )
        return "The marks show the detected head, hands and feet. Drag a mark if its place is wrong."

    @property
    def marks(self) -> Int:
        """Returns the vertices (5,) at the limb ends. Returns an empty array while the search for them runs,
        or if nothing is selected.
        """
        shape = self.editor.find_selected(GraphCharacter)
        if shape is None:
            return np.empty(0, np.int64)
        if len(shape.ends):
            vertices = scipy.spatial.cKDTree(shape.mesh.vertices).query(shape.ends)[1].astype(np.int64)
        else:
            vertices = self._suggest_ends(shape.mesh).copy()
        if self._held_mark is not None and len(vertices):
            vertices[self._held_mark[0]] = self._held_mark[1]
        return np.asarray(vertices)

    def hover(self, pointer: Pointer) -> None:
        """Does nothing: only the marks can be grabbed."""

    def press(self, pointer: Pointer) -> bool:
        """Grabs the nearest mark within reach, otherwise selects the clicked character.

        Returns False without a mark, so that the drag turns the view.
        """
        shape, self.editor.playing = self.editor.find_selected(GraphCharacter), False
        if shape is not None and len(marks := self.marks):
            distances = np.linalg.norm(self._find_pixels(shape.id, marks) - np.array(pointer.at), axis=1)
            if distances.min() <= max(self.editor.settings.reach, _MARK_RADIUS_PX):
                end = int(distances.argmin())
                self._held_mark = end, int(marks[end])
                return True
        hit = self.character_at(pointer)
        if hit is not None and hit.character != self.editor.selection.character:
            self.editor.select_only(hit.character)
        return False

    def drag(self, pointer: Pointer) -> None:
        """Moves the grabbed mark to the vertex under the pointer. Outside of the mesh, the mark stays."""
        shape = self.editor.find_selected(GraphCharacter)
        if self._held_mark is None or shape is None:
            return
        posed, lens = self.editor.stage_character(shape.id), self.editor.lens
        hit = find_surface_at([posed], lens, pointer.at)
        if hit is not None:
            place = lens.view.eye + hit.depth * lens.ray(pointer.at)
            self._held_mark = (
                self._held_mark[0],
                find_hit_vertex(posed.vertices, shape.mesh.faces[hit.face], place),
            )

    def release(self, pointer: Pointer) -> None:
        """Stores the positions of all marks as one edit. The detected marks become fixed, too."""
        shape, held, marks = self.editor.find_selected(GraphCharacter), self._held_mark, self.marks
        self._held_mark = None
        if shape is not None and held is not None:
            self._store_ends(shape, shape.mesh.vertices[marks], later("name the {0}", _END_WORDS[held[0]]))

    def type(self, key: str) -> bool:
        """Deletes the stored marks for Delete and Backspace, so that they are detected again."""
        shape = self.editor.find_selected(GraphCharacter)
        if key not in ("delete", "backspace") or shape is None or not len(shape.ends):
            return False
        self._store_ends(shape, np.empty((0, 3)), tr("find the ends"))
        return True

    def cancel(self) -> None:
        """Cancels the drag. The mark returns to its earlier place."""
        super().cancel()
        self._held_mark = None

    def overlay(self) -> Overlay:
        """Returns a labelled disc for each visible mark. Stored marks have another colour than detected
        marks.
        """
        shape, marks = self.editor.find_selected(GraphCharacter), self.marks
        if shape is None or not len(marks):
            return Overlay()
        colour = ACCENT if len(shape.ends) else QUIET
        end_marks: list[Disc | Label] = []
        for number, (pixel, label) in enumerate(
            zip(self._find_pixels(shape.id, marks), END_NAMES, strict=True)
        ):
            if not np.isfinite(pixel).all():
                continue
            held = self._held_mark is not None and self._held_mark[0] == number
            place: Point = (float(pixel[0]), float(pixel[1]))
            end_marks += [
                Disc(place, _MARK_RADIUS_PX, colour),
                Disc(place, _MARK_RADIUS_PX, MARK, 3.0 if held else 1.5),
            ]
            end_marks.append(
                Label((place[0] + _LABEL_OFFSET_PX[0], place[1] + _LABEL_OFFSET_PX[1]), label, MARK)
            )
        return Overlay(tuple(end_marks))

    def wait(self) -> None:
        """Waits until the limb ends are found. For sessions without a window."""
        if self._search is not None:
            self._search.result()

    def _find_pixels(self, character: str, vertices: Int) -> Float:
        """Returns (5, 2) pixels of vertices in the character's current pose."""
        return self.editor.lens.project(self.editor.stage_character(character).vertices[vertices])[0]

    def _suggest_ends(self, mesh: Mesh) -> Int:
        """Returns the detected vertices (5,) at the limb ends, or an empty result while the search runs."""
        if self._mesh is not mesh:
            self._mesh = mesh
            self._threads = self._threads or ThreadPoolExecutor(1, "suggested ends")
            self._search = self._threads.submit(suggest_ends, mesh)
        search = self._search
        return search.result() if search is not None and search.done() else np.empty(0, np.int64)

    def _store_ends(self, shape: GraphCharacter, ends: Float, step: str) -> None:
        def named(project: Project) -> Project:
            return project.with_characters(shape.with_changes(ends=ends, joints=np.empty((0, 3))))

        self.editor.edit(step, named)


def suggest_ends(mesh: Mesh) -> Int:
    """Returns the vertices (5,) at a mesh's head, hands and feet.

    If the mesh does not look like a person, the vertices nearest to a standing figure of its size are used.
    """
    try:
        person = find_person_in_mesh(mesh)
    except EnlivenError:  # The mesh has no area, so no person can be fitted.
        person = None
    if person is not None:
        ends = person.ends
    else:
        low, high = mesh.bounds
        foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
        ends = make_standing_figure(float(high[1] - low[1]))[_FIGURE_JOINTS] + foot
    return np.asarray(scipy.spatial.cKDTree(mesh.vertices).query(ends)[1], np.int64)
