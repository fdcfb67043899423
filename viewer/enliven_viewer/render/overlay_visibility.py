"""Visibility of overlays during a performance. Skeletons are shown while a performer chooses, and fade out
after the possession.
"""

from __future__ import annotations

from dataclasses import replace

from enliven_viewer.playback.timeline import TimelineMoment
from enliven_viewer.render.scene import SceneStyle
from enliven_viewer.settings import RenderSettings

_FADE_S = 1.2
"""Duration of the fade-out in seconds."""


class OverlayVisibility:
    """The visibility of skeletons and attachment points, which fade out once a mesh is possessed.

    Args:
        linger: seconds for which the overlays stay visible before they fade.
    """

    def __init__(self, settings: RenderSettings, linger: float) -> None:
        self._when, self._linger = settings.skeleton, linger
        self._since: float | None = None

    def style(self, wanted: SceneStyle, moment: TimelineMoment | None, second: float) -> SceneStyle:
        """Returns the style ``wanted`` with the overlays faded for a moment. ``second`` is a time in seconds
        from an arbitrary start.
        """
        overlay_strength = self._overlay_strength(moment, second)
        body = overlay_strength
        if moment is not None and moment.props is not None and self._when != "never":
            # A performer without a mesh is visible only as a skeleton, so always show it.
            holding = sum(cues.state == "possessed" for cues in moment.cues.values())
            body = 1.0 if len(moment.bodies) > holding else overlay_strength
        return replace(
            wanted,
            body=body * wanted.body,
            reveal=overlay_strength * wanted.reveal,
            cues=overlay_strength * wanted.cues,
        )

    def _overlay_strength(self, moment: TimelineMoment | None, second: float) -> float:
        """Returns the strength of the overlays, 0 to 1."""
        if self._when != "choosing":
            return float(self._when == "always")
        if moment is None or not moment.possessed or _is_choosing(moment):
            self._since = None
            return 1.0
        if self._since is None:
            self._since = second
        left = 1 - min(max((second - self._since - self._linger) / _FADE_S, 0.0), 1.0)
        return left * left * (3 - 2 * left)


def _is_choosing(moment: TimelineMoment) -> bool:
    """Returns True if a preview of a possession is shown, even if another performer already possesses the
    character.
    """
    previewed = any(len(cues.nodes) and not cues.attached_mask.all() for cues in moment.cues.values())
    return previewed or any(board.state == "choosing" for board in moment.boards.values())
