"""Selects the image pairs of two live cameras that are kept for a calibration."""

from __future__ import annotations

import numpy as np

from enliven.arrays import UInt8
from enliven_edge.sensors.stereo.board import CalibrationBoard
from enliven_edge.sensors.stereo.solving import BoardSighting

_STILL = 0.01
"""Part of the image's width by which corners may have moved since the look before: the board is still."""
_FRESH = 0.06
"""Part of the image's width by which corners must differ from those of each pair that was kept."""
_COMMON = 8
"""Corners that two sightings must share to be compared."""


class Keeper:
    """Keeps pairs in which both cameras see the board, held still in a new place or at a new angle.

    Attributes:
        kept: the sightings.
    """

    def __init__(self, board: CalibrationBoard) -> None:
        self._board = board
        self._before: BoardSighting | None = None
        self.kept: list[BoardSighting] = []

    def offer(self, left: UInt8, right: UInt8) -> str:
        """Tries a pair; returns an empty string where it was kept, else what to do."""
        seen = BoardSighting(str(len(self.kept) + 1), self._board.find(left), self._board.find(right))
        before, self._before = self._before, seen
        for side in ("left", "right"):
            if len(getattr(seen, side)) < _COMMON:
                return f"the {side} camera does not see enough of the board"
        width = left.shape[1]
        if before is None or _moved(before, seen) > _STILL * width:
            return "hold the board still"
        if any(_moved(each, seen) < _FRESH * width for each in self.kept):
            return "move or tilt the board"
        self.kept.append(seen)
        return ""


def _moved(one: BoardSighting, other: BoardSighting) -> float:
    """Mean pixels between shared corners, the larger of both cameras'; infinite where too few are shared."""
    moved = []
    for side in ("left", "right"):
        a, b = getattr(one, side), getattr(other, side)
        shared = a.keys() & b.keys()
        if len(shared) < _COMMON:
            return float("inf")
        moved.append(float(np.mean([np.linalg.norm(a[n] - b[n]) for n in shared])))
    return max(moved)
