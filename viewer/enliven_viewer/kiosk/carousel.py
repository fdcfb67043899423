"""The carousel of characters. The offered character stands on the spot, and smaller neighbours stand next to
it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from enliven.document import Character
from enliven.kiosk.visitors import Place
from enliven_viewer.kiosk.figures import WaitingPlace, stand_character
from enliven_viewer.render.scene import SceneCharacter

_MOVE_TIME_S = 0.15
"""Time constant of the carousel's motion, in seconds."""
_GAP_M = 1.05
"""Distance in metres between two adjacent characters."""
_NEIGHBOUR_DISTANCE_M = 0.7
"""Distance in metres from the offered character back to its neighbours."""
_NEIGHBOUR_SCALE = 0.55
"""Size of a neighbour relative to the offered character."""
_MIN_OPENING = 0.03
"""Fraction of the carousel's opening animation, 0..1, below which no neighbour is visible."""

_MAX_OFFSET = 1.6
"""Maximum distance of a visible neighbour from the offered character, counted in places of the carousel."""

_HIDDEN_SIZE = 1e-4
"""Scale factor of a character that is not visible. A character of 1 m becomes 0.1 mm high."""


class Carousel:
    """The neighbours of the offered character."""

    def __init__(self) -> None:
        self._position = 0.0
        self._opening = 0.0

    def draw(
        self,
        names: Sequence[str],
        characters: Mapping[str, Character],
        offered: str,
        place: Place,
        *,
        open: bool,
        seconds: float,
    ) -> list[SceneCharacter]:
        """Returns the neighbours in this frame.

        Args:
            names: the characters in the order of the carousel.
            offered: the character on the spot, which is not drawn here.
            open: True while the neighbours are shown.
        """
        count = len(names)
        if count < 2 or offered not in names:
            return []
        gain = -math.expm1(-seconds / _MOVE_TIME_S)
        self._opening += gain * (float(open) - self._opening)
        goal = names.index(offered)
        self._position += gain * _shortest_way(goal - self._position, count)
        if self._opening < _MIN_OPENING:
            # Nothing is visible, but the meshes stay in GPU memory. So no frame waits for an upload when a
            # visitor appears.
            hidden = WaitingPlace(place, size=_HIDDEN_SIZE)
            return [stand_character(characters[name], hidden) for name in names if name != offered]
        offsets = {
            name: _shortest_way(k - self._position, count) for k, name in enumerate(names) if name != offered
        }
        return [self._stand(characters[name], offset, place) for name, offset in offsets.items()]

    def _stand(self, character: Character, offset: float, place: Place) -> SceneCharacter:
        """Returns a neighbour at its place, ``offset`` places from the offered one. Positive offsets are on
        the right of the mirrored picture.
        """
        # Beyond the neighbours' places, characters shrink to nothing as they move around the back.
        fade = min(max((_MAX_OFFSET - abs(offset)) / (_MAX_OFFSET - 1.0), 0.0), 1.0)
        size = max(_NEIGHBOUR_SCALE * self._opening * fade, _HIDDEN_SIZE)
        x = place[0] - offset * _GAP_M
        z = place[1] - _NEIGHBOUR_DISTANCE_M * min(abs(offset), 1.0)
        return stand_character(character, WaitingPlace((x, z), 0.35 * offset, size=size))


def _shortest_way(steps: float, count: int) -> float:
    """Returns the signed shortest distance, in places, around a carousel of ``count`` places."""
    return (steps + count / 2) % count - count / 2
