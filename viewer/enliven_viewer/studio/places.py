"""The layout of the panels in a window, in pixels: around the viewport, so that nothing covers the work."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

MENU = 23.0
"""Pixels, height of the menu bar: a line of text."""
TOOLS = 92.0
"""Pixels, width of the toolbar: a button of 72 with room."""
SIDE = 288.0
"""Pixels, width of the side panel: two buttons of 126 side by side."""
TIMELINE = 196.0
"""Pixels, height of the timeline: the transport, the ruler and five lanes."""
LEAST = 118.0
"""Pixels, height of the timeline in a window with less room: the transport, the ruler, and a lane."""
PICTURE = 270.0
"""Pixels of height below which the picture takes room from the timeline."""
CURVES = 178.0
"""Pixels, height of the curves: as much as three lines of values need."""
STRIP = 142.0
"""Pixels, height of the strip of key poses with a puppet: a title and a row of tiles."""
PERFORMER = 0.36
"""Share of the picture that the performer has with a puppet: the puppet stays the larger."""
HOLDER = 48.0
"""Pixels, height of a line of large words about who holds what."""


class Area(NamedTuple):
    """x, y of the top left, width and height."""

    x: float
    y: float
    width: float
    height: float

    def holds(self, x: float, y: float) -> bool:
        """Whether a pixel is inside."""
        return self.x <= x < self.x + self.width and self.y <= y < self.y + self.height


class Places(NamedTuple):
    """The areas of one window size."""

    tools: Area
    side: Area
    timeline: Area
    viewport: Area
    performer: Area | None = None
    strip: Area | None = None
    curves: Area | None = None


def places_in(
    width: float, height: float, *, puppet: bool = False, curves: bool = False, without: Collection[str] = ()
) -> Places:
    """Tools at the left, properties at the right, the timeline along the bottom, the rest for the picture.

    With a puppet the performer has the left of the picture, and its key poses a strip under both. Curves lie
    over the timeline, where that is shown. In a low window the timeline leaves the picture some height.

    Args:
        without: "menu", "tools", "side", "timeline": what is not shown, and has no width or height.
    """
    menu, left = MENU * ("menu" not in without), TOOLS * ("tools" not in without)
    right = SIDE * ("side" not in without)
    room = height - menu - PICTURE - CURVES * curves - STRIP * puppet
    low = height - min(max(room, LEAST), TIMELINE) * ("timeline" not in without)
    timeline, above = Area(0.0, low, width, height - low), None
    if curves and timeline.height:
        low -= CURVES
        above = Area(0.0, low, width, CURVES)
    tools = Area(0.0, menu, left, low - menu)
    side = Area(width - right, menu, right, low - menu)
    rest = Area(left, menu, max(width - left - right, 1.0), max(low - menu, 1.0))
    if not puppet:
        return Places(tools, side, timeline, rest, curves=above)
    high, wide = max(rest.height - STRIP, 1.0), round(PERFORMER * rest.width)
    performer = Area(rest.x, rest.y, wide, high)
    strip = Area(rest.x, rest.y + high, rest.width, STRIP)
    viewport = Area(rest.x + wide, rest.y, max(rest.width - wide, 1.0), high)
    return Places(tools, side, timeline, viewport, performer, strip, above)
