"""Places the tour's card and arrow near their target, so that they cover nothing important."""

from __future__ import annotations

import math
from collections.abc import Sequence

Rectangle = tuple[float, float, float, float]
"""Left, top, right and bottom in pixels."""
Segment = tuple[tuple[float, float], tuple[float, float]]
"""Start and end of an arrow in pixels."""
_MAX_ARROW_PX = 56.0
"""Maximum length of an arrow in pixels. A longer arrow would cross widgets next to the target."""
_MIN_ARROW_PX = 11.0
"""Minimum length of an arrow in pixels. A shorter arrow would only consist of its head."""
_TARGET_GAP_PX = 26.0
"""Gap in pixels between the card and its target: space for the arrow."""
_EDGE_MARGIN_PX = 10.0
"""Distance in pixels between the card and the border of the window."""
_TARGET_COVER_COST = 1e6
"""Cost of covering the target, relative to covering other areas."""


def place_card(
    size: tuple[float, float],
    window: Rectangle,
    target: Rectangle | None,
    others: Sequence[Rectangle] = (),
    picture: Rectangle | None = None,
    before: tuple[float, float] | None = None,
) -> tuple[float, float]:
    """Returns the top left corner of the card. The card is next to its target, or in the corner where it
    covers the least.

    Args:
        size: width and height of the card.
        window: area in which the card may be.
        others: further areas that it should not cover.
        picture: area of the view; its corners are preferred.
        before: previous position. The card stays there unless it covers the target.
    """
    if before is not None and not _compute_cost(before, size, target, ()):
        return before
    left, top, right, bottom = window
    width, height = size
    max_distance = (
        max(right - width - _EDGE_MARGIN_PX, left + _EDGE_MARGIN_PX),
        max(bottom - height - _EDGE_MARGIN_PX, top + _EDGE_MARGIN_PX),
    )
    corners = [*(_find_corners(size, picture) if picture is not None else []), *_find_corners(size, window)]
    if target is None:
        return min(corners, key=lambda position: _compute_cost(position, size, None, others))
    middle = (target[0] + target[2] - width) / 2, (target[1] + target[3] - height) / 2
    positions = [
        (target[0] - width - _TARGET_GAP_PX, middle[1]),
        (target[2] + _TARGET_GAP_PX, middle[1]),
        (middle[0], target[3] + _TARGET_GAP_PX),
        (middle[0], target[1] - height - _TARGET_GAP_PX),
        (target[0] - width - _TARGET_GAP_PX, target[3] + _TARGET_GAP_PX),
        (target[2] + _TARGET_GAP_PX, target[3] + _TARGET_GAP_PX),
    ]
    clamped = [
        (
            min(max(x, left + _EDGE_MARGIN_PX), max_distance[0]),
            min(max(y, top + _EDGE_MARGIN_PX), max_distance[1]),
        )
        for x, y in positions
    ]
    # min returns the first of several positions with equal cost. The nearest positions come first in the
    # list.
    return min([*clamped, *corners], key=lambda position: _compute_cost(position, size, target, others))


def place_arrow(card: Rectangle, target: Rectangle, widgets: Sequence[Rectangle]) -> Segment | None:
    """Returns the arrow to a target. It comes from the card, or from a direction in which it crosses no other
    widget.

    Only the end of a long arrow is drawn; it still shows the direction.

    Args:
        widgets: the widgets of the window. They may include the target.

    Returns:
        The arrow, or None if the card is too close to the target.
    """
    start, end = _find_nearest_points(card, target)
    length = math.dist(start, end)
    if length < _MIN_ARROW_PX:
        return None
    fraction = max(1.0 - _MAX_ARROW_PX / length, 0.0)
    begin = start[0] + fraction * (end[0] - start[0]), start[1] + fraction * (end[1] - start[1])
    x, y = (target[0] + target[2]) / 2, (target[1] + target[3]) / 2
    arrows: tuple[Segment, ...] = (
        (begin, end),
        ((x, target[3] + _MAX_ARROW_PX), (x, target[3])),
        ((x, target[1] - _MAX_ARROW_PX), (x, target[1])),
        ((target[0] - _MAX_ARROW_PX, y), (target[0], y)),
        ((target[2] + _MAX_ARROW_PX, y), (target[2], y)),
    )
    others = [widget for widget in widgets if not _do_touch(widget, target)]
    free = (arrow for arrow in arrows if not any(_do_touch(_find_bounds(arrow), widget) for widget in others))
    return next(free, arrows[0])


def _find_nearest_points(card: Rectangle, target: Rectangle) -> Segment:
    """Returns the nearest points of two rectangles."""
    start, end = [0.0, 0.0], [0.0, 0.0]
    for axis in (0, 1):
        low, high = max(card[axis], target[axis]), min(card[axis + 2], target[axis + 2])
        if low <= high:
            start[axis] = end[axis] = (low + high) / 2
        elif card[axis + 2] < target[axis]:
            start[axis], end[axis] = card[axis + 2], target[axis]
        else:
            start[axis], end[axis] = card[axis], target[axis + 2]
    return (start[0], start[1]), (end[0], end[1])


def _find_bounds(arrow: Segment) -> Rectangle:
    """Returns the bounding box of an arrow."""
    (left, top), (right, bottom) = arrow
    return min(left, right), min(top, bottom), max(left, right), max(top, bottom)


def _do_touch(first: Rectangle, second: Rectangle) -> bool:
    """Returns True if two rectangles, which may have no width or height, have a point in common."""
    across = min(first[2], second[2]) >= max(first[0], second[0])
    return across and min(first[3], second[3]) >= max(first[1], second[1])


def _find_corners(size: tuple[float, float], area: Rectangle) -> list[tuple[float, float]]:
    """Returns the top left corner of a card in each corner of an area, the right corners first."""
    left, top, right, bottom = area
    across = max(right - size[0] - _EDGE_MARGIN_PX, left + _EDGE_MARGIN_PX), left + _EDGE_MARGIN_PX
    down = max(bottom - size[1] - _EDGE_MARGIN_PX, top + _EDGE_MARGIN_PX), top + _EDGE_MARGIN_PX
    return [(x, y) for x in across for y in down]


def _compute_cost(
    position: tuple[float, float],
    size: tuple[float, float],
    target: Rectangle | None,
    others: Sequence[Rectangle],
) -> float:
    """Returns the cost of a position: the covered area in square pixels. Covering the target has by far the
    highest cost.
    """
    card = position[0], position[1], position[0] + size[0], position[1] + size[1]
    cost = sum(_measure_overlap(card, other) for other in others)
    return round(cost + (_TARGET_COVER_COST * _measure_overlap(card, target) if target is not None else 0.0))


def _measure_overlap(first: Rectangle, second: Rectangle) -> float:
    width = min(first[2], second[2]) - max(first[0], second[0])
    height = min(first[3], second[3]) - max(first[1], second[1])
    return max(width, 0.0) * max(height, 0.0)
