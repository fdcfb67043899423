"""Collects all pointer positions between two frames. ImGui reports only the last position."""

from __future__ import annotations

import math

PointerPosition = tuple[float, float]
"""Position in pixels from the window's top left corner."""
_MAX_POSITIONS = 4096
"""Maximum number of stored positions: four seconds of a mouse with 1000 events per second."""


class PointerPath:
    """The positions from the window's events. Each frame takes the positions up to ImGui's current position.
    ImGui processes moves and button changes in order, and stops at the next button change of a frame. Later
    positions are kept for the next frame, so that a stroke begins at the position of the button press.
    """

    def __init__(self) -> None:
        self._positions: list[PointerPosition] = []

    def add(self, x: float, y: float) -> None:
        """Adds the position of a pointer event, in whole pixels like ImGui's."""
        self._positions.append((float(math.floor(x)), float(math.floor(y))))
        del self._positions[:-_MAX_POSITIONS]

    def take(self, at: PointerPosition) -> list[PointerPosition]:
        """Returns and removes the positions up to ImGui's current position ``at``, which comes last."""
        if at not in self._positions:
            # The pointer was moved without an event, for example by a test. So the older positions do not
            # belong to its path.
            self._positions.clear()
            return [at]
        end = self._positions.index(at) + 1
        taken, self._positions = self._positions[:end], self._positions[end:]
        return taken
