"""Things of unlike sizes beside one another: said where one is opened, and fitted by one action."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from enliven.arrays import Float
from enliven.document import Project
from enliven.modeling.edits import foot_of, move_character, scale_character, vertices_of
from enliven_viewer.language import tr
from enliven_viewer.studio.actions import Action
from enliven_viewer.studio.editor import Editor

_UNLIKE = 2.0
"""Times as tall as the others, or as small, from which a thing looks lost or in the way."""
_ALIKE = 0.01
"""Share of the height within which there is nothing to fit."""


class Fitting:
    """The height of the chosen character beside that of the others."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor

    def heights(self) -> tuple[float, float] | None:
        """Metres: the chosen character's height, and the middle one of the others; None without either."""
        return self._heights({one.id: one.vertices for one in self.editor.standing})

    def _heights(self, seen: Mapping[str, Float]) -> tuple[float, float] | None:
        """Returns the same, for the vertices (V, 3) of every character."""
        found = {name: float(np.ptp(one[:, 1])) for name, one in seen.items() if len(one)}
        own = found.pop(self.editor.selection.character or "", 0.0)
        others = [height for height in found.values() if height > 0.0]
        return (own, float(np.median(others))) if own > 0.0 and others else None

    def lacks(self) -> str:
        """Returns why nothing can be fitted, and what to do about it."""
        heights = self.heights()
        if heights is None:
            return "Nothing is there to fit it to. Choose one thing that stands beside others."
        same = abs(heights[0] / heights[1] - 1.0) < _ALIKE
        return "It is as tall as the others. Choose one that is not." if same else ""

    def fit(self) -> None:
        """Makes the chosen character as tall as the others; it stands where it stood."""
        name, project, time = self.editor.selection.character, self.editor.project, self.editor.time
        # What is shown of a puppet may be of a moment ago: it is solved in the background.
        seen = {one: vertices_of(project, one, time) for one, each in project.characters.items() if each.mesh}
        heights = self._heights(seen)
        if name is None or heights is None:
            return
        scaled = scale_character(project, name, heights[1] / heights[0])
        way = foot_of(seen[name]) - foot_of(vertices_of(scaled, name, time))

        def change(project: Project) -> Project:
            return move_character(scale_character(project, name, heights[1] / heights[0]), name, way)

        self.editor.edit("fit its size", change)

    def tell(self) -> None:
        """Says that what was just opened is of another size than the others, and how it is fitted."""
        heights = self.heights()
        if heights is None or 1.0 / _UNLIKE < heights[0] / heights[1] < _UNLIKE:
            return
        said = tr("It is {0:.3g} m tall, beside {1:.3g} m", heights[0], heights[1])
        self.editor.toasts.say(said, tr("Alt+F makes it as tall as the others."))


def fitting_actions(fitting: Fitting) -> Iterator[Action]:
    """Fits the chosen character to the others."""
    about = "As tall as what stands beside it."
    yield Action(
        "shape.fit", "Shape", "Fit to the others' size", ("alt+f",), fitting.fit, fitting.lacks, about=about
    )
