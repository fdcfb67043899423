"""Position and size of the selection, and the edits that change them."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Project
from enliven.errors import InputError
from enliven.modeling.edits import group_centre, move_characters, scale_characters
from enliven.rotation import from_rotation_vector
from enliven_viewer.language import later, tr
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.viewport.selection import Selection

AXES = ("x", "y", "z")
_MIN_SCALABLE_HEIGHT_M = 1e-3
"""Minimum height in metres for changing the height. A flatter object cannot be scaled to a height."""
_MAX_HEIGHT_M = 1000.0
"""Maximum height in metres. A larger number is a typing error."""


class SelectionTransform:
    """The position and size of the selection in its current pose."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self._bounds_cache: tuple[Project, Selection, float, tuple[Float, Float] | None] | None = None

    @property
    def box(self) -> tuple[Float, Float] | None:
        """Returns the lowest and the highest corner (3,) of the selection in metres.

        Returns None without a selection.
        """
        editor, cached = self.editor, self._bounds_cache
        same = cached is not None and cached[0] is editor.project and cached[1] == editor.selection
        if cached is None or not same or not (editor.playing or cached[2] == editor.time):
            # During playback, do not update the numbers in each frame. They would be unreadable, and skinning
            # would lower the frame rate.
            cached = self._bounds_cache = (
                editor.project,
                editor.selection,
                editor.time,
                self._find_surface_bounds(),
            )
        return cached[3]

    def _find_surface_bounds(self) -> tuple[Float, Float] | None:
        names = self.editor.selection.characters
        characters = [character for character in self.editor.stage_characters if character.id in names]
        points = [
            character.vertices if len(character.vertices) else character.handles for character in characters
        ]
        if not points or not all(len(places) for places in points):
            return None
        return np.min([places.min(0) for places in points], axis=0), np.max(
            [places.max(0) for places in points], axis=0
        )

    @property
    def place(self) -> Float | None:
        """Returns the horizontal centre (3,) in metres of the selection, at the height of its lowest
        point.
        """
        box = self.box
        if box is None:
            return None
        middle = (box[0] + box[1]) / 2.0
        return np.array([middle[0], box[0][1], middle[2]])

    @property
    def height(self) -> float | None:
        """Returns the height of the selection in metres, or None without a selection."""
        box = self.box
        return None if box is None else float(box[1][1] - box[0][1])

    def move_to(self, axis: int, metres: float) -> None:
        """Moves the selection along one world axis to a coordinate."""
        place, names = self.place, self.editor.selection.characters
        if place is not None:
            offset = np.eye(3)[axis] * (metres - place[axis])
            self.editor.edit(
                later("place {0}", self._subject_name), lambda p: move_characters(p, names, offset)
            )

    def set_height(self, metres: float) -> None:
        """Scales the selection to a height in metres, in place.

        Raises:
            InputError: if the selection is flat, or the height is invalid.
        """
        height = self.height
        if height is None:
            return
        if not (height > _MIN_SCALABLE_HEIGHT_M and _MIN_SCALABLE_HEIGHT_M <= metres <= _MAX_HEIGHT_M):
            problem = (
                tr("the shape is flat")
                if height <= _MIN_SCALABLE_HEIGHT_M
                else tr("{0:g} m is not a possible height", metres)
            )
            raise InputError(problem, remedy=tr("Type a height such as 1.7 m or 150 %."))
        self.scale(metres / height)

    def scale(self, factor: float) -> None:
        """Scales the selection in place."""
        place, names = self.place, self.editor.selection.characters
        if place is None:
            return

        def change(project: Project) -> Project:
            fixed_point = _find_fixed_point(project, names)
            project = scale_characters(project, names, factor)
            return move_characters(project, names, (factor - 1.0) * (fixed_point - place))

        self.editor.edit(later("size of {0}", self._subject_name), change)

    def turn(self, axis: int, degrees: float) -> None:
        """Turns the selection about a world axis through its position."""
        place, names = self.place, self.editor.selection.characters
        if place is not None:
            turn = from_rotation_vector(np.eye(3)[axis] * np.radians(degrees))
            zero_offset = np.zeros(3)
            self.editor.edit(
                later("turn {0}", self._subject_name),
                lambda p: move_characters(p, names, zero_offset, turn, place),
            )

    @property
    def _subject_name(self) -> str:
        names = self.editor.selection.characters
        return names[0] if len(names) == 1 else later("{0} shapes", len(names))


def _find_fixed_point(project: Project, names: tuple[str, ...]) -> Float:
    """Returns the centre of scaling (3,) in metres. For several characters, it is on the floor."""
    middle = group_centre(project, names)
    return middle if len(names) == 1 else middle * [1.0, 0.0, 1.0]
