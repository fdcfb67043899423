"""The size of an opened model: a likely one if the file's own is implausible, or that of other characters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Project
from enliven.modeling.edits import compute_vertices, find_base_centre, move_character, scale_character
from enliven_viewer.language import later, tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.editor.editor import Editor

_MIN_SIZE_M = 0.25
"""Minimum plausible size in metres. The file of a smaller model is assumed to use another unit."""
_MAX_HEIGHT_M = 3.0
"""Maximum plausible height in metres. The file of a taller model is assumed to use another unit, because the
stage is made for people.
"""
_MAX_LENGTH_M = 4.5
"""Maximum plausible length in metres: twice the length of a horse. The file of a longer or wider model is
assumed to use another unit.
"""
_UNITS = (
    ("centimetres", 0.01),
    ("millimetres", 0.001),
    ("kilometres", 1000.0),
    (later("hundreds of metres"), 100.0),
)
"""Units that some programs write instead of metres, with their length in metres."""
_PLAUSIBLE_LENGTHS_M = (0.5, 3.0)
"""Plausible range of a model's longest side in metres, from a small dog to a horse with its tail. A unit is
accepted if the size is in this range.
"""
_PERSON_HEIGHT_M = 1.7
"""Height in metres of a model without a plausible size: the height of a person."""
_MAX_FALLBACK_LENGTH_M = 3.5
"""Maximum length in metres of the longest side of a model that gets the height of a person."""


@dataclass(frozen=True)
class ModelSize:
    """The height to which an opened model is scaled.

    Attributes:
        height: height in metres after scaling.
        note: explanation for the user; empty if the file's own size is kept.
    """

    height: float
    note: str = ""


def choose_size(points: AnyArray | Sequence[Sequence[float]]) -> ModelSize:
    """Returns the size for a model with (N, 3) points in the file's metres, +Y up.

    If another unit gives a plausible size, the file is read in that unit. Otherwise a model of an implausible
    size gets the height of a person.
    """
    extent = np.ptp(np.asarray(points, float), axis=0)
    tall, longest = float(extent[1]), float(extent.max())
    if tall <= 0.0 or (longest >= _MIN_SIZE_M and tall <= _MAX_HEIGHT_M and longest <= _MAX_LENGTH_M):
        return ModelSize(tall)
    for unit_name, metres in _UNITS:
        if _PLAUSIBLE_LENGTHS_M[0] <= longest * metres <= _PLAUSIBLE_LENGTHS_M[1]:
            note = tr(
                "the model was {0:.3g} m tall, so it was read in {1}: {2:.2g} m",
                tall,
                tr(unit_name),
                tall * metres,
            )
            return ModelSize(tall * metres, note)
    height = min(_PERSON_HEIGHT_M, _MAX_FALLBACK_LENGTH_M * tall / longest)
    return ModelSize(height, tr("the model was {0:.3g} m tall, so it was scaled to {1:.2g} m", tall, height))


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

    def find_missing(self) -> str:
        """Returns the reason why the selected character cannot be scaled to the others, with advice, or an
        empty text if it can.
        """
        heights = self.heights()
        if heights is None:
            return "The project has no other shape to compare with. Choose a shape next to other shapes."
        same = abs(heights[0] / heights[1] - 1.0) < _HEIGHT_TOLERANCE
        return "The shape is already as tall as the others. Choose another shape." if same else ""

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

    def show_size_hint(self) -> None:
        """Shows a hint if the character that was just opened differs much in height from the others."""
        heights = self.heights()
        if heights is None or 1.0 / _MISMATCH_RATIO < heights[0] / heights[1] < _MISMATCH_RATIO:
            return
        message = tr("The new shape is {0:.3g} m tall, the others {1:.3g} m", heights[0], heights[1])
        self.editor.toasts.show_message(
            message, tr("Press Alt+F to make the new shape as tall as the others.")
        )


def make_fitting_actions(fitting: SizeMatching) -> Iterator[Action]:
    """Yields the action that scales the selected character to the others' height."""
    description = "Scales the chosen shape to the height of the other shapes."
    yield Action(
        "shape.fit",
        "Shape",
        "Fit to the others' height",
        ("alt+f",),
        fitting.fit,
        fitting.find_missing,
        about=description,
    )
