"""Demonstrates one part of a tour step. An animated hand moves to the target, and the action is executed."""

from __future__ import annotations

import math

from enliven_viewer.studio.app.targets import Target
from enliven_viewer.studio.features.tour.tour_state import TourState
from enliven_viewer.studio.features.tour.tour_steps import TourPart
from enliven_viewer.studio.viewport.overlay import Point

_GLIDE_S = 0.9
"""Duration in seconds of the hand's movement to the target, slow enough to follow."""
_PRESS_S = 0.35
"""Pause in seconds before the hand acts."""
_DRAG_S = 1.4
"""Duration in seconds of a drag along a path."""
_LETTER_S = 0.06
"""Time in seconds between two letters of a typed name."""
_MAX_STEP_PX = 5.0
"""Maximum distance in pixels between two points of a dragged path, so that a slow frame does not make the
stroke coarse.
"""


class Demonstration:
    """The animated hand of the tour, which demonstrates one part of a step.

    Args:
        toured: the tour's interface to the studio.
        part: the part to demonstrate.
        start: initial position of the hand, in the window's pixels.

    Attributes:
        hand: current position of the hand, in the window's pixels.
        presses: True while it holds the mouse button.
        shift: True while it holds the Shift key.
        ended: whether the demonstration is over.
        typed: letters to type into the focused field; :meth:`take_typed` fetches them.
    """

    def __init__(self, toured: TourState, part: TourPart, start: Point) -> None:
        self.part, self.hand, self.presses, self.shift, self.ended = part, start, False, False, False
        self.typed = ""
        self._state, self._start, self._elapsed_s = toured, start, 0.0
        self._path: tuple[Point, ...] = ()
        self._last_point: Point = (0.0, 0.0)
        self._origin: Point = (0.0, 0.0)

    def advance(self, seconds: float, target: Target, place: Point | None, origin: Point) -> None:
        """Advances the demonstration by a time step.

        Args:
            target: the current target of the part.
            place: centre of the target, in the window's pixels; None if the target is not visible.
            origin: the top left corner of the image, in the window's pixels.
        """
        if self.ended:
            return
        old_elapsed_s, self._elapsed_s, self._origin = self._elapsed_s, self._elapsed_s + seconds, origin
        if self._path:
            self._drag()
            return
        aim = self._find_path_start(target) or place or self.hand
        fraction = min(self._elapsed_s / _GLIDE_S, 1.0)
        eased = fraction * fraction * (3.0 - 2.0 * fraction)
        self.hand = _interpolate(self._start, aim, eased)
        self.presses = self._elapsed_s > _GLIDE_S
        if self._elapsed_s < _GLIDE_S + _PRESS_S:
            return
        if target.path:
            self._begin(target)
        elif self.part.types:
            self._type(old_elapsed_s)
        else:
            self.part.command(self._state)
            self._end()

    def take_typed(self) -> str:
        """Returns the letters typed since the last call."""
        typed, self.typed = self.typed, ""
        return typed

    def cancel(self) -> None:
        """Stops the demonstration and cancels a stroke that it began."""
        if self._path:
            self._state.workspace.input.tool.cancel()
            self._state.workspace.input.release(self._path[-1])
        self._end()

    def _find_path_start(self, target: Target) -> Point | None:
        """Returns the start of the path, in the window's pixels, or None without a path."""
        if not target.path:
            return None
        return target.path[0][0] + self._origin[0], target.path[0][1] + self._origin[1]

    def _begin(self, target: Target) -> None:
        """Presses the mouse button. Pauses playback, so that the path stays valid."""
        self._path, self._elapsed_s, self.shift = target.path, 0.0, self.part.shift
        hands = self._state.workspace.input
        hands.press(self._path[0], shift=False)
        self._last_point = self._path[0]

    def _drag(self) -> None:
        fraction = min(self._elapsed_s / _DRAG_S, 1.0)
        aim = _find_path_point(self._path, fraction)
        hands = self._state.workspace.input
        for point in _list_path_points(self._last_point, aim):
            hands.move(point, shift=self.shift)
        self._last_point = aim
        self.hand = aim[0] + self._origin[0], aim[1] + self._origin[1]
        if fraction >= 1.0:
            hands.release(aim, shift=self.shift)
            self._end()

    def _type(self, before: float) -> None:
        """Types the name letter by letter."""
        typing_start_s = _GLIDE_S + _PRESS_S
        count = int(max(self._elapsed_s - typing_start_s, 0.0) / _LETTER_S)
        previous_count = int(max(before - typing_start_s, 0.0) / _LETTER_S)
        name = _find_free_name(self._state, self.part.types)
        self.typed += name[previous_count:count]
        if previous_count >= len(name):
            self._end()

    def _end(self) -> None:
        self.ended, self.presses, self.shift = True, False, False


def _find_free_name(toured: TourState, name: str) -> str:
    """Returns a file name that does not exist yet, so that no file is replaced."""
    browser, number, free = toured.workspace.browser, 1, name
    while browser is not None and (browser.folder / f"{free}.enliven").exists():
        number += 1
        free = f"{name} {number}"
    return free


def _interpolate(start: Point, end: Point, fraction: float) -> Point:
    return start[0] + fraction * (end[0] - start[0]), start[1] + fraction * (end[1] - start[1])


def _find_path_point(path: tuple[Point, ...], fraction: float) -> Point:
    """Returns the point at a fraction of a path. All segments of the path take the same time."""
    position = fraction * (len(path) - 1)
    index = min(int(position), len(path) - 2)
    return _interpolate(path[index], path[index + 1], position - index)


def _list_path_points(start: Point, end: Point) -> list[Point]:
    """Returns points along a segment, close to each other."""
    count = max(math.ceil(math.dist(start, end) / _MAX_STEP_PX), 1)
    return [_interpolate(start, end, (k + 1) / count) for k in range(count)]
