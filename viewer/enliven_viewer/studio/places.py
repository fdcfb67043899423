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
TIMELINE_MOST = 0.75
"""Share of the window's height that an artist can give the timeline."""
LEAST = 118.0
"""Pixels, height of the timeline in a window with less room: the transport, the ruler, and a lane."""
PICTURE = 270.0
"""Pixels of height below which the picture takes room from the timeline."""
CURVES = 178.0
"""Pixels, height of the curves: as much as three lines of values need."""
STRIP = 142.0
"""Pixels, height of the strip of key poses with a puppet: a title and a row of tiles."""
STRIP_PICTURE = 190.0
"""Pixels of height that a puppet's picture keeps: in a lower window there is no strip of key poses."""
PERFORMER_LEAST = 150.0
"""Pixels, least width of the performer: the choice of its take. It has up to half of a narrow picture."""
PERFORMER = 0.36
"""Share of the picture that the performer has with a puppet: the puppet stays the larger."""
HINT = 32.0
"""Pixels, height of the strip under the picture with the tool's hint: two lines of small letters."""
HINT_OVER = 480.0
"""Least width in pixels of a picture with the hint over it, above the characters."""
HOLDER = 48.0
"""Pixels, height of a line of large words about who holds what."""


class Area(NamedTuple):
    """x, y of the top left, width and height."""

    x: float
    y: float
    width: float
    height: float

    def holds(self, x: float, y: float) -> bool:
        """Returns True if a pixel is inside."""
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
    hint: Area | None = None


def places_in(
    width: float,
    height: float,
    *,
    puppet: bool = False,
    curves: bool = False,
    hinted: bool = False,
    timeline_height: float = TIMELINE,
    without: Collection[str] = (),
) -> Places:
    """Tools at the left, properties at the right, the timeline along the bottom, the rest for the picture.

    With a puppet the performer has the left of the picture, and its key poses a strip under both, unless the
    window is too low: the timeline has them too. Curves lie
    over the timeline, where that is shown. In a low window the timeline leaves the picture some height.

    Args:
        timeline_height: pixels that the artist gave the timeline.
        hinted: whether the tool has a hint; under a narrow picture it has a strip of its own.
        without: "menu", "tools", "side", "timeline": what is not shown, and has no width or height.
    """
    menu, left = MENU * ("menu" not in without), TOOLS * ("tools" not in without)
    right = SIDE * ("side" not in without)
    room = height - menu - PICTURE - CURVES * curves - STRIP * puppet - HINT * hinted
    usual = min(max(room, LEAST), TIMELINE)
    if timeline_height != TIMELINE:  # chosen by the artist, so the picture may be lower
        usual = max(min(timeline_height, TIMELINE_MOST * height - CURVES * curves), LEAST)
    low = height - usual * ("timeline" not in without)
    timeline, above = Area(0.0, low, width, height - low), None
    if curves and timeline.height:
        low -= CURVES
        above = Area(0.0, low, width, CURVES)
    hint = None
    if hinted and width - left - right < HINT_OVER:
        low -= HINT
        hint = Area(0.0, low, width, HINT)
    tools = Area(0.0, menu, left, low - menu)
    side = Area(width - right, menu, right, low - menu)
    rest = Area(left, menu, max(width - left - right, 1.0), max(low - menu, 1.0))
    if not puppet:
        return Places(tools, side, timeline, rest, curves=above, hint=hint)
    stripped = STRIP if rest.height - STRIP >= STRIP_PICTURE else 0.0
    high = max(rest.height - stripped, 1.0)
    wide = round(min(max(PERFORMER * rest.width, PERFORMER_LEAST), rest.width / 2))
    performer = Area(rest.x, rest.y, wide, high)
    strip = Area(rest.x, rest.y + high, rest.width, STRIP) if stripped else None
    viewport = Area(rest.x + wide, rest.y, max(rest.width - wide, 1.0), high)
    return Places(tools, side, timeline, viewport, performer, strip, above, hint)
