"""Where the panels are in a window, pixels: fixed around the viewport, so that nothing covers the work."""

from __future__ import annotations

from typing import NamedTuple

MENU, TOOLS, SIDE, TIMELINE = 23.0, 92.0, 288.0, 196.0


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


def places_in(width: float, height: float) -> Places:
    """Tools at the left, properties at the right, the timeline along the bottom, the rest for the picture."""
    low = height - TIMELINE
    return Places(
        Area(0.0, MENU, TOOLS, low - MENU),
        Area(width - SIDE, MENU, SIDE, low - MENU),
        Area(0.0, low, width, TIMELINE),
        Area(TOOLS, MENU, max(width - TOOLS - SIDE, 1.0), max(low - MENU, 1.0)),
    )
