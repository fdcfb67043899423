"""Computes the layout of the panels in a window, in pixels. Panels are around the viewport and do not cover
it.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

MENU_HEIGHT = 23.0
"""Height of the menu bar in pixels: one line of text."""
TOOLBAR_WIDTH = 92.0
"""Width of the toolbar in pixels: a button of 72 with margins."""
SIDE_PANEL_WIDTH = 288.0
"""Width of the side panel in pixels: two buttons of 126 side by side."""
TIMELINE_HEIGHT = 196.0
"""Height of the timeline in pixels: the transport, the ruler and five lanes."""
MAX_TIMELINE_FRACTION = 0.75
"""Maximum height of the timeline as a fraction of the window's height."""
MIN_TIMELINE_HEIGHT = 118.0
"""Minimum height of the timeline in pixels, in a low window: the transport, the ruler, and one lane."""
MIN_VIEW_HEIGHT = 270.0
"""Minimum height of the view in pixels. In a low window, the timeline shrinks to leave this height."""
CURVES_HEIGHT = 178.0
"""Height of the curve area in pixels. It fits three labelled values."""
STRIP_HEIGHT = 142.0
"""Height in pixels of a puppet's strip of key poses: a title and a row of tiles."""
MIN_VIEW_HEIGHT_WITH_STRIP = 190.0
"""Minimum height in pixels of a puppet's view. In a lower window the strip of key poses is hidden."""
MIN_PERFORMER_WIDTH = 150.0
"""Minimum width in pixels of the performer's view, so that its take can be chosen. In a narrow view, it takes
at most half of the width.
"""
PERFORMER_WIDTH_FRACTION = 0.36
"""Fraction of the view's width for the performer, so that the puppet stays larger."""
HINT_STRIP_HEIGHT = 32.0
"""Height in pixels of the hint strip below the view: two lines of small text."""
MIN_WIDTH_WITH_HINT = 480.0
"""Minimum width in pixels of a view that shows the hint inside it, above the characters."""
HOLDER_LINE_HEIGHT = 48.0
"""Height in pixels of a line of large text about the performers and their characters."""


class Area(NamedTuple):
    """A rectangle: x and y of the top left corner, width and height."""

    x: float
    y: float
    width: float
    height: float

    def contains(self, x: float, y: float) -> bool:
        """Returns True if a pixel is inside the rectangle."""
        return self.x <= x < self.x + self.width and self.y <= y < self.y + self.height


class SideSplit:
    """The division of the right panel: the outliner above, the selection below.

    Attributes:
        fraction: fraction of the height for the outliner. The default has eight rows at 1280x720.
        column: the area of both.
    """

    def __init__(self) -> None:
        self.fraction = 0.46
        self.column = Area(0.0, 0.0, 0.0, 0.0)

    def divide(self, column: Area) -> tuple[Area, Area]:
        """Returns the two parts of a column."""
        self.column, height = column, round(self.fraction * column.height)
        return (
            Area(column.x, column.y, column.width, height),
            Area(column.x, column.y + height, column.width, column.height - height),
        )


class PanelLayout(NamedTuple):
    """The areas of the panels at one window size."""

    tools: Area
    side: Area
    timeline: Area
    viewport: Area
    performer: Area | None = None
    strip: Area | None = None
    curves: Area | None = None
    hint: Area | None = None


def lay_out_panels(
    width: float,
    height: float,
    *,
    puppet: bool = False,
    curves: bool = False,
    hinted: bool = False,
    timeline_height: float = TIMELINE_HEIGHT,
    without: Collection[str] = (),
) -> PanelLayout:
    """Returns the areas of the panels and of the view.

    Tools are at the left, properties at the right, the timeline is at the bottom, and the view takes the
    rest.

    With a puppet, the performer is at the left of the view, and the strip of key poses is below both. A low
    window has no strip, because the timeline also shows the key poses. Curves are above the timeline if it is
    shown. In a low window, the timeline shrinks so that the view keeps its minimum height.

    Args:
        timeline_height: height of the timeline chosen by the artist, in pixels.
        hinted: True if the tool has a hint. A narrow view has a separate strip for the hint below it.
        without: hidden panels, any of "menu", "tools", "side" and "timeline". Their areas have zero width or
            height.
    """
    menu, left = MENU_HEIGHT * ("menu" not in without), TOOLBAR_WIDTH * ("tools" not in without)
    right = SIDE_PANEL_WIDTH * ("side" not in without)
    free_height = (
        height
        - menu
        - MIN_VIEW_HEIGHT
        - CURVES_HEIGHT * curves
        - STRIP_HEIGHT * puppet
        - HINT_STRIP_HEIGHT * hinted
    )
    default_height = min(max(free_height, MIN_TIMELINE_HEIGHT), TIMELINE_HEIGHT)
    if timeline_height != TIMELINE_HEIGHT:
        # The user has chosen the height of the timeline, so the view may be lower than usual.
        default_height = max(
            min(timeline_height, MAX_TIMELINE_FRACTION * height - CURVES_HEIGHT * curves), MIN_TIMELINE_HEIGHT
        )
    is_low_window = height - default_height * ("timeline" not in without)
    timeline, above = Area(0.0, is_low_window, width, height - is_low_window), None
    if curves and timeline.height:
        is_low_window -= CURVES_HEIGHT
        above = Area(0.0, is_low_window, width, CURVES_HEIGHT)
    hint = None
    if hinted and width - left - right < MIN_WIDTH_WITH_HINT:
        is_low_window -= HINT_STRIP_HEIGHT
        hint = Area(0.0, is_low_window, width, HINT_STRIP_HEIGHT)
    tools = Area(0.0, menu, left, is_low_window - menu)
    side = Area(width - right, menu, right, is_low_window - menu)
    rest = Area(left, menu, max(width - left - right, 1.0), max(is_low_window - menu, 1.0))
    if not puppet:
        return PanelLayout(tools, side, timeline, rest, curves=above, hint=hint)
    stripped = STRIP_HEIGHT if rest.height - STRIP_HEIGHT >= MIN_VIEW_HEIGHT_WITH_STRIP else 0.0
    height_above_timeline = max(rest.height - stripped, 1.0)
    wide = round(min(max(PERFORMER_WIDTH_FRACTION * rest.width, MIN_PERFORMER_WIDTH), rest.width / 2))
    performer = Area(rest.x, rest.y, wide, height_above_timeline)
    strip = Area(rest.x, rest.y + height_above_timeline, rest.width, STRIP_HEIGHT) if stripped else None
    viewport = Area(rest.x + wide, rest.y, max(rest.width - wide, 1.0), height_above_timeline)
    return PanelLayout(tools, side, timeline, viewport, performer, strip, above, hint)
