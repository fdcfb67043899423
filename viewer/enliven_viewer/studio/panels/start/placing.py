"""Where the tour's card is placed: near what it means, and over nothing that is needed."""

from __future__ import annotations

from collections.abc import Sequence

Rectangle = tuple[float, float, float, float]
"""Left, top, right, bottom in pixels."""
_GAP = 26.0
"""Pixels between the card and its target: room for the arrow."""
_EDGE = 10.0
"""Pixels between the card and the edge of the window."""
_MEANT = 1e6
"""Cost of covering what is meant, over that of covering something else."""


def place_card(
    size: tuple[float, float],
    window: Rectangle,
    meant: Rectangle | None,
    others: Sequence[Rectangle] = (),
    picture: Rectangle | None = None,
    before: tuple[float, float] | None = None,
) -> tuple[float, float]:
    """Returns the top left of the card: next to its target, or in the corner where it covers least.

    Args:
        size: width and height of the card.
        window: where the card may be.
        others: what it should not cover either.
        picture: the corners of the picture come first.
        before: where the card was; it stays there unless it covers what is meant.
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
    # Of places that are as good the first is taken: the nearest ones.
    return min([*clamped, *corners], key=lambda at: _cost(at, size, meant, others))


def _corners(size: tuple[float, float], area: Rectangle) -> list[tuple[float, float]]:
    """Returns the top left of a card in each corner of an area, those at the right first."""
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
    """Returns pixels squared that a card would cover; those of its target cost by far the most."""
    card = at[0], at[1], at[0] + size[0], at[1] + size[1]
    cost = sum(_common(card, one) for one in others)
    return round(cost + (_MEANT * _common(card, meant) if meant is not None else 0.0))


def _common(one: Rectangle, other: Rectangle) -> float:
    wide = min(one[2], other[2]) - max(one[0], other[0])
    high = min(one[3], other[3]) - max(one[1], other[1])
    return max(wide, 0.0) * max(high, 0.0)
