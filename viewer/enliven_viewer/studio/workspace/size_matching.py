"""Detects different sizes of characters: shows a hint when a file is opened, and offers an action that makes
them equal.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from enliven.arrays import Float
from enliven.document import Project
from enliven.modeling.edits import compute_vertices, find_base_centre, move_character, scale_character
from enliven_viewer.language import tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.editor.editor import Editor

_MISMATCH_RATIO = 2.0
"""A hint is shown if the height ratio to the other characters, or its inverse, exceeds this value."""
_HEIGHT_TOLERANCE = 0.01
"""Relative height difference below which heights count as equal."""


class SizeMatching:
    """Compares the selected character's height with the other characters', and scales it to their height."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor

    def heights(self) -> tuple[float, float] | None:
        """Returns the selected character's height and the median height of the others, in metres.

        Returns None if either is missing.
        """
        return self._compare_heights(
            {character.id: character.vertices for character in self.editor.stage_characters}
        )

    def _compare_heights(self, surfaces: Mapping[str, Float]) -> tuple[float, float] | None:
        """Returns the result of :meth:`heights` for given vertices (V, 3) of every character."""
        heights = {
            name: float(np.ptp(vertices[:, 1])) for name, vertices in surfaces.items() if len(vertices)
        }
        selected_height = heights.pop(self.editor.selection.character or "", 0.0)
        others = [height for height in heights.values() if height > 0.0]
        return (selected_height, float(np.median(others))) if selected_height > 0.0 and others else None

    def lacks(self) -> str:
        """Returns the reason why the selected character cannot be scaled to the others, with advice, or an
        empty text if it can.
        """
        heights = self.heights()
        if heights is None:
            return "No other shape to compare with. Choose one that stands next to others."
        same = abs(heights[0] / heights[1] - 1.0) < _HEIGHT_TOLERANCE
        return "It is already as tall as the others. Choose another shape." if same else ""

    def fit(self) -> None:
        """Scales the selected character to the median height of the others, in place."""
        name, project, time = self.editor.selection.character, self.editor.project, self.editor.time
        # Compute the surfaces here, because a shown surface of a puppet may be outdated. Puppets are solved
        # in the background.
        surfaces = {
            other: compute_vertices(project, other, time)
            for other, character in project.characters.items()
            if character.mesh
        }
        heights = self._compare_heights(surfaces)
        if name is None or heights is None:
            return
        scaled = scale_character(project, name, heights[1] / heights[0])
        offset = find_base_centre(surfaces[name]) - find_base_centre(compute_vertices(scaled, name, time))

        def change(project: Project) -> Project:
            return move_character(scale_character(project, name, heights[1] / heights[0]), name, offset)

        self.editor.edit("fit its size", change)

    def tell(self) -> None:
        """Shows a hint if the character that was just opened differs much in height from the others."""
        heights = self.heights()
        if heights is None or 1.0 / _MISMATCH_RATIO < heights[0] / heights[1] < _MISMATCH_RATIO:
            return
        message = tr("It is {0:.3g} m tall, the others {1:.3g} m", heights[0], heights[1])
        self.editor.toasts.say(message, tr("Alt+F makes it as tall as the others."))


def make_fitting_actions(fitting: SizeMatching) -> Iterator[Action]:
    """Yields the action that scales the selected character to the others' height."""
    about = "Scales it to the height of the other shapes."
    yield Action(
        "shape.fit", "Shape", "Fit to the others' size", ("alt+f",), fitting.fit, fitting.lacks, about=about
    )
