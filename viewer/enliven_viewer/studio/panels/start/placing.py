"""The placement of the tour's card: near its target, without covering anything important."""

from __future__ import annotations

from collections.abc import Sequence

Rectangle = tuple[float, float, float, float]
"""Left, top, right and bottom in pixels."""
_GAP = 26.0
"""Gap in pixels between the card and its target: space for the arrow."""
_EDGE = 10.0
"""Distance in pixels between the card and the border of the window."""
_MEANT = 1e6
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
    furthest = max(right - wide - _EDGE, left + _EDGE), max(bottom - high - _EDGE, top + _EDGE)
    corners = [*(_corners(size, picture) if picture is not None else []), *_corners(size, window)]
    if meant is None:
        return min(corners, key=lambda at: _cost(at, size, None, others))
    middle = (meant[0] + meant[2] - wide) / 2, (meant[1] + meant[3] - high) / 2
    beside = [
        (meant[0] - wide - _GAP, middle[1]),
        (meant[2] + _GAP, middle[1]),
        (middle[0], meant[3] + _GAP),
        (middle[0], meant[1] - high - _GAP),
        (meant[0] - wide - _GAP, meant[3] + _GAP),
        (meant[2] + _GAP, meant[3] + _GAP),
    ]
    clamped = [
        (min(max(x, left + _EDGE), furthest[0]), min(max(y, top + _EDGE), furthest[1])) for x, y in beside
    ]
    # min returns the first of equally good places. The nearest places come first in the list.
    return min([*clamped, *corners], key=lambda at: _cost(at, size, meant, others))


def _corners(size: tuple[float, float], area: Rectangle) -> list[tuple[float, float]]:
    """Returns the top left corner of a card in each corner of an area, those at the right first."""
    left, top, right, bottom = area
    across = max(right - size[0] - _EDGE, left + _EDGE), left + _EDGE
    down = max(bottom - size[1] - _EDGE, top + _EDGE), top + _EDGE
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
    return round(cost + (_MEANT * _common(card, meant) if meant is not None else 0.0))


def _common(one: Rectangle, other: Rectangle) -> float:
    wide = min(one[2], other[2]) - max(one[0], other[0])
    high = min(one[3], other[3]) - max(one[1], other[1])
    return max(wide, 0.0) * max(high, 0.0)
