"""Does one part of a step of the tour for the artist: a hand goes there, and the real action is done."""

from __future__ import annotations

import math

from enliven_viewer.studio.start.steps import TourPart
from enliven_viewer.studio.start.target import Target
from enliven_viewer.studio.start.toured import Toured
from enliven_viewer.studio.viewport import Point

_GLIDE_S = 0.9
"""Seconds of the way of the hand to the target: the eye follows it."""
_PRESS_S = 0.35
"""Seconds that the hand rests before it acts."""
_DRAG_S = 1.4
"""Seconds of the way along a path."""
_LETTER_S = 0.06
"""Seconds from one letter of a typed name to the next."""
_APART = 5.0
"""Pixels between two points of a dragged path: a slow picture does not make the stroke coarse."""


class Demonstration:
    """The hand of the tour, which does one part.

    Args:
        toured: the studio.
        part: what is done.
        start: where the hand begins, in the window's pixels.

    Attributes:
        hand: where the hand is, in the window's pixels.
        presses: whether it holds the button.
        shift: whether it holds Shift.
        ended: whether it has done its part.
        typed: the letters that are to be typed into the field with the focus; taken by :meth:`take_typed`.
    """

    def __init__(self, toured: Toured, part: TourPart, start: Point) -> None:
        self.part, self.hand, self.presses, self.shift, self.ended = part, start, False, False, False
        self.typed = ""
        self._toured, self._start, self._at = toured, start, 0.0
        self._path: tuple[Point, ...] = ()
        self._last: Point = (0.0, 0.0)
        self._origin: Point = (0.0, 0.0)

    def advance(self, seconds: float, target: Target, place: Point | None, origin: Point) -> None:
        """Lets time pass.

        Args:
            target: where the part points now.
            place: the middle of the target, in the window's pixels; None if it cannot be seen.
            origin: the top left of the picture, in the window's pixels.
        """
        if self.ended:
            return
        before, self._at, self._origin = self._at, self._at + seconds, origin
        if self._path:
            self._drag()
            return
        aim = self._first(target) or place or self.hand
        share = min(self._at / _GLIDE_S, 1.0)
        eased = share * share * (3.0 - 2.0 * share)
        self.hand = _between(self._start, aim, eased)
        self.presses = self._at > _GLIDE_S
        if self._at < _GLIDE_S + _PRESS_S:
            return
        if target.path:
            self._begin(target)
        elif self.part.types:
            self._type(before)
        else:
            self.part.command(self._toured)
            self._end()

    def take_typed(self) -> str:
        """Returns the letters since the last call."""
        typed, self.typed = self.typed, ""
        return typed

    def cancel(self) -> None:
        """Stop; what was begun is dropped."""
        if self._path:
            self._toured.desk.input.tool.cancel()
            self._toured.desk.input.release(self._path[-1])
        self._end()

    def _first(self, target: Target) -> Point | None:
        """Returns the begin of the path, in the window's pixels; None without a path."""
        if not target.path:
            return None
        return target.path[0][0] + self._origin[0], target.path[0][1] + self._origin[1]

    def _begin(self, target: Target) -> None:
        """Presses the button; what plays stands still from then on, so that the path stays right."""
        self._path, self._at, self.shift = target.path, 0.0, self.part.shift
        hands = self._toured.desk.input
        hands.press(self._path[0], shift=False)
        self._last = self._path[0]

    def _drag(self) -> None:
        share = min(self._at / _DRAG_S, 1.0)
        aim = _along(self._path, share)
        hands = self._toured.desk.input
        for point in _steps(self._last, aim):
            hands.move(point, shift=self.shift)
        self._last = aim
        self.hand = aim[0] + self._origin[0], aim[1] + self._origin[1]
        if share >= 1.0:
            hands.release(aim, shift=self.shift)
            self._end()

    def _type(self, before: float) -> None:
        """Types the name a letter at a time."""
        since = _GLIDE_S + _PRESS_S
        count = int(max(self._at - since, 0.0) / _LETTER_S)
        known = int(max(before - since, 0.0) / _LETTER_S)
        name = _free_name(self._toured, self.part.types)
        self.typed += name[known:count]
        if known >= len(name):
            self._end()

    def _end(self) -> None:
        self.ended, self.presses, self.shift = True, False, False


def _free_name(toured: Toured, name: str) -> str:
    """Returns a name without a file yet: nothing is replaced."""
    browser, number, free = toured.desk.browser, 1, name
    while browser is not None and (browser.folder / f"{free}.enliven").exists():
        number += 1
        free = f"{name} {number}"
    return free


def _between(start: Point, end: Point, share: float) -> Point:
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])


def _along(path: tuple[Point, ...], share: float) -> Point:
    """Returns the place at a share of a path, its parts being of equal time."""
    at = share * (len(path) - 1)
    index = min(int(at), len(path) - 2)
    return _between(path[index], path[index + 1], at - index)


def _steps(start: Point, end: Point) -> list[Point]:
    """Returns the points of a way, near to each other."""
    count = max(math.ceil(math.dist(start, end) / _APART), 1)
    return [_between(start, end, (k + 1) / count) for k in range(count)]
