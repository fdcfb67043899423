"""The placement of the tour's card and arrow: near their target, without covering anything important."""

from __future__ import annotations

import math
from collections.abc import Sequence

Rectangle = tuple[float, float, float, float]
"""Left, top, right and bottom in pixels."""
Segment = tuple[tuple[float, float], tuple[float, float]]
"""Start and end of an arrow in pixels."""
_MAX_ARROW_PX = 56.0
"""Maximum length of an arrow in pixels. A longer one would cross the target's neighbours."""
_MIN_ARROW_PX = 11.0
"""Minimum length of an arrow in pixels: it would only be a head."""
_TARGET_GAP_PX = 26.0
"""Gap in pixels between the card and its target: space for the arrow."""
_EDGE_MARGIN_PX = 10.0
"""Distance in pixels between the card and the border of the window."""
_TARGET_COVER_COST = 1e6
"""Cost of covering the target, relative to covering other areas."""


def place_card(
    size: tuple[float, float],
    window: Rectangle,
    meant: Rectangle | None,
    others: Sequence[Rectangle] = (),
    picture: Rectangle | None = None,
    before: tuple[float, float] | None = None,
) -> tuple[float, float]:
    """Returns the top left corner of the card: next to its target, or in the corner where it covers least.

    Args:
        size: width and height of the card.
        window: area in which the card may be.
        others: further areas that it should not cover.
        picture: area of the view; its corners are preferred.
        before: previous position. The card stays there unless it covers the target.
    """
    if before is not None and not _cost(before, size, meant, ()):
        return before
    left, top, right, bottom = window
    wide, high = size
    furthest = (
        max(right - wide - _EDGE_MARGIN_PX, left + _EDGE_MARGIN_PX),
        max(bottom - high - _EDGE_MARGIN_PX, top + _EDGE_MARGIN_PX),
    )
    corners = [*(_corners(size, picture) if picture is not None else []), *_corners(size, window)]
    if meant is None:
        return min(corners, key=lambda at: _cost(at, size, None, others))
    middle = (meant[0] + meant[2] - wide) / 2, (meant[1] + meant[3] - high) / 2
    beside = [
        (meant[0] - wide - _TARGET_GAP_PX, middle[1]),
        (meant[2] + _TARGET_GAP_PX, middle[1]),
        (middle[0], meant[3] + _TARGET_GAP_PX),
        (middle[0], meant[1] - high - _TARGET_GAP_PX),
        (meant[0] - wide - _TARGET_GAP_PX, meant[3] + _TARGET_GAP_PX),
        (meant[2] + _TARGET_GAP_PX, meant[3] + _TARGET_GAP_PX),
    ]
    clamped = [
        (min(max(x, left + _EDGE_MARGIN_PX), furthest[0]), min(max(y, top + _EDGE_MARGIN_PX), furthest[1]))
        for x, y in beside
    ]
    # min returns the first of equally good places. The nearest places come first in the list.
    return min([*clamped, *corners], key=lambda at: _cost(at, size, meant, others))


def place_arrow(card: Rectangle, meant: Rectangle, widgets: Sequence[Rectangle]) -> Segment | None:
    """Returns the arrow to a target: from the card, or from a side where it crosses no other widget.

    Only the end of a long arrow is drawn; it still shows the direction.

    Args:
        widgets: the widgets of the window, with the target or without.

    Returns:
        The arrow, or None if the card is too close for one.
    """
    start, end = _nearest(card, meant)
    length = math.dist(start, end)
    if length < _MIN_ARROW_PX:
        return None
    share = max(1.0 - _MAX_ARROW_PX / length, 0.0)
    begin = start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])
    x, y = (meant[0] + meant[2]) / 2, (meant[1] + meant[3]) / 2
    arrows: tuple[Segment, ...] = (
        (begin, end),
        ((x, meant[3] + _MAX_ARROW_PX), (x, meant[3])),
        ((x, meant[1] - _MAX_ARROW_PX), (x, meant[1])),
        ((meant[0] - _MAX_ARROW_PX, y), (meant[0], y)),
        ((meant[2] + _MAX_ARROW_PX, y), (meant[2], y)),
    )
    others = [widget for widget in widgets if not _touch(widget, meant)]
    free = (arrow for arrow in arrows if not any(_touch(_bounds(arrow), widget) for widget in others))
    return next(free, arrows[0])


def _nearest(card: Rectangle, meant: Rectangle) -> Segment:
    """Returns the nearest points of two rectangles."""
    start, end = [0.0, 0.0], [0.0, 0.0]
    for axis in (0, 1):
        low, high = max(card[axis], meant[axis]), min(card[axis + 2], meant[axis + 2])
        if low <= high:
            start[axis] = end[axis] = (low + high) / 2
        elif card[axis + 2] < meant[axis]:
            start[axis], end[axis] = card[axis + 2], meant[axis]
        else:
            start[axis], end[axis] = card[axis], meant[axis + 2]
    return (start[0], start[1]), (end[0], end[1])


def _bounds(arrow: Segment) -> Rectangle:
    """Returns the bounding box of an arrow."""
    (left, top), (right, bottom) = arrow
    return min(left, right), min(top, bottom), max(left, right), max(top, bottom)


def _touch(first: Rectangle, second: Rectangle) -> bool:
    """Returns True if two rectangles, which may have no width or height, have a point in common."""
    across = min(first[2], second[2]) >= max(first[0], second[0])
    return across and min(first[3], second[3]) >= max(first[1], second[1])


def _corners(size: tuple[float, float], area: Rectangle) -> list[tuple[float, float]]:
    """Returns the top left corner of a card in each corner of an area, those at the right first."""
    left, top, right, bottom = area
    across = max(right - size[0] - _EDGE_MARGIN_PX, left + _EDGE_MARGIN_PX), left + _EDGE_MARGIN_PX
    down = max(bottom - size[1] - _EDGE_MARGIN_PX, top + _EDGE_MARGIN_PX), top + _EDGE_MARGIN_PX
    return [(x, y) for x in across for y in down]


def _cost(
    at: tuple[float, float],
    size: tuple[float, float],
    meant: Rectangle | None,
    others: Sequence[Rectangle],
) -> float:
    """Returns the covered area in square pixels; the target's area has by far the highest cost."""
    card = at[0], at[1], at[0] + size[0], at[1] + size[1]
    cost = sum(_common(card, other) for other in others)
    return round(cost + (_TARGET_COVER_COST * _common(card, meant) if meant is not None else 0.0))


def _common(one: Rectangle, other: Rectangle) -> float:
    wide = min(one[2], other[2]) - max(one[0], other[0])
    high = min(one[3], other[3]) - max(one[1], other[1])
    return max(wide, 0.0) * max(high, 0.0)
