"""Every place that the pointer was at between two pictures: ImGui tells only the last of them."""

from __future__ import annotations

import math

Spot = tuple[float, float]
"""Pixels of the window from its top left."""
_MOST = 4096
"""Places that are kept: four seconds of a mouse that tells a thousand a second."""


class PointerPath:
    """The places that the window's own events told, taken picture by picture up to where ImGui is.

    ImGui takes moves and buttons in their order, and goes no further in one picture than to the next change
    of a button. What lies beyond is kept for the next picture: a stroke begins where the button went down.
    """

    def __init__(self) -> None:
        self._told: list[Spot] = []

    def tell(self, x: float, y: float) -> None:
        """An event: the pointer is at a place now; whole pixels, as ImGui counts them."""
        self._told.append((float(math.floor(x)), float(math.floor(y))))
        del self._told[:-_MOST]

    def take(self, at: Spot) -> list[Spot]:
        """Returns the places up to the one where ImGui has the pointer, which is the last."""
        if at not in self._told:
            self._told.clear()  # it was moved without an event, as by a test
            return [at]
        end = self._told.index(at) + 1
        taken, self._told = self._told[:end], self._told[end:]
        return taken
