"""The sketch tool: a closed stroke becomes a part with bones and weights."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Project, unused
from enliven.modeling.sketching.sketch import SketchPlane, shape_from_stroke
from enliven_viewer.language import tr, tr_n
from enliven_viewer.studio.tools.base import Pointer, StrokeTool
from enliven_viewer.studio.viewport.overlay import Disc, Line, Overlay, Point
from enliven_viewer.theme import GOOD, STROKE

_CLOSING_DISTANCE_PX = 22.0
"""A stroke counts as closed if its end is within this distance in pixels of its start."""
_MIN_POINTS = 8
"""Minimum number of points of a stroke. A shorter stroke is an accidental click."""


class SketchTool(StrokeTool):
    """A tool that draws a stroke around a part.

    The plane of the stroke goes through the camera's target, parallel to the image.
    """

    name, label, key, icon = "sketch", "Sketch part", "s", "\uf040"

    @property
    def hint(self) -> str:
        """Returns the way to draw a closed stroke."""
        if self._closed:
            return "Release: the stroke is closed."
        if self._stroke:
            return "Draw around the part, back to where you began."
        return "Draw the outline of a part: a limb, a body, a tentacle. It becomes a shape with bones."

    def release(self, pointer: Pointer) -> None:
        """Turns a closed stroke into a part."""
        stroke = self.take_points()
        if not stroke:
            return
        if len(stroke) < _MIN_POINTS:
            self.editor.toasts.show_message(tr("The stroke is too short"), tr("Draw all around the part."))
            return
        plane, points = self._project_to_plane(stroke)
        names: list[str] = []

        def change(project: Project) -> Project:
            name = unused("part", project.characters)
            names.append(name)
            return project.with_characters(shape_from_stroke(points, plane, id=name))

        if self.editor.edit("sketch part", change):
            self.editor.select_only(names[-1])
            bones = len(self.editor.project.characters[names[-1]].handles) - 1
            message = tr_n("A part with {0} bone", "A part with {0} bones", bones)
            self.editor.toasts.show_message(
                message,
                tr("Press G to move the part, or M to give it motion. You can rename the part at the right."),
            )

    def overlay(self) -> Overlay:
        """Returns the stroke and its start. Both change colour if the stroke is closed."""
        if len(self._stroke) < 2:
            return Overlay()
        closed = self._closed
        line = Line(tuple(self._stroke), GOOD if closed else STROKE, 2.5, closed)
        return Overlay((line, Disc(self._stroke[0], 6.0, GOOD if closed else STROKE, 2.0)))

    @property
    def _closed(self) -> bool:
        if len(self._stroke) < _MIN_POINTS:
            return False
        (ax, ay), (bx, by) = self._stroke[0], self._stroke[-1]
        return bool(np.hypot(ax - bx, ay - by) < _CLOSING_DISTANCE_PX)

    def _project_to_plane(self, stroke: list[Point]) -> tuple[SketchPlane, Float]:
        """Returns the plane through the camera's target parallel to the image, and the stroke in it.

        The stroke is in metres.
        """
        lens = self.editor.lens
        through = self.editor.camera.target
        right, up = lens.view.camera_from_world[0, :3], lens.up
        places = np.array([lens.intersect_plane(pixel, through) for pixel in stroke])
        return SketchPlane(through, right, up), (places - through) @ np.stack([right, up], 1)
