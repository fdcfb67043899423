"""Overlays of a performance: skeletons while something is chosen, then the mesh alone with what is held."""

from __future__ import annotations

from dataclasses import replace

from enliven_viewer.playback import TimelineMoment
from enliven_viewer.render.scene import SceneStyle
from enliven_viewer.settings import RenderSettings

_FADE = 1.2
"""Seconds in which the overlays go: slow enough not to be seen as a jump."""


class Showing:
    """Lets skeletons and attachment points fade once a mesh is held.

    Args:
        linger: seconds for which they stay then.
    """

    def __init__(self, settings: RenderSettings, linger: float) -> None:
        self._when, self._linger = settings.skeleton, linger
        self._since: float | None = None

    def style(self, wanted: SceneStyle, moment: TimelineMoment | None, second: float) -> SceneStyle:
        """Returns the style at a moment, ``second`` seconds after any beginning, of what is wanted."""
        shown = self._shown(moment, second)
        body = shown
        if moment is not None and moment.props is not None and self._when != "never":
            # A performer who plays along without a mesh has nothing else to be seen by.
            holding = sum(cues.state == "possessed" for cues in moment.cues.values())
            body = 1.0 if len(moment.bodies) > holding else shown
        return replace(
            wanted, body=body * wanted.body, reveal=shown * wanted.reveal, cues=shown * wanted.cues
        )

    def _shown(self, moment: TimelineMoment | None, second: float) -> float:
        """0 to 1, how strongly the overlays are seen."""
        if self._when != "choosing":
            return float(self._when == "always")
        if moment is None or not moment.possessed or _choosing(moment):
            self._since = None
            return 1.0
        if self._since is None:
            self._since = second
        left = 1 - min(max((second - self._since - self._linger) / _FADE, 0.0), 1.0)
        return left * left * (3 - 2 * left)


def _choosing(moment: TimelineMoment) -> bool:
    """Returns True if a performer sees what would be held now, beside what is."""
    previewed = any(len(cues.nodes) and not cues.firm.all() for cues in moment.cues.values())
    return previewed or any(board.state == "choosing" for board in moment.boards.values())
