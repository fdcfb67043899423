"""Easing: what is shown never jumps, whatever happens to what is computed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven_edge.stage.placement import turn_about_y, yaw_between

_STEEPEST = 1.5 * np.pi / 2
"""Of the easing at its middle, times the way along a half turn over the way across it."""

State = tuple[Float, Float]
"""(N, 3, 3) linear parts and (N, 3) positions, world frame."""


@dataclass(frozen=True)
class _Gap:
    """How what was shown differs from what is to be shown: a turn, a size and a way of the whole, and the
    rest of it node by node, in the frame of what is to be shown."""

    yaw: float
    growth: float
    way: Float
    linear: Float
    positions: Float


class Fading:
    """Eases over changes by keeping the gap they tear, and closing it while what is computed moves on.

    While a gap closes, no node is shown faster than it is computed (the gap's turn and growth carried along)
    by more than ``pace``, or 1.5 / seconds times the gap's length, pi / 2 of it where the gap is a turn.

    Args:
        seconds: that a gap takes to close.
        pace: metres a second; a gap too wide for it takes longer.
    """

    def __init__(self, seconds: float, pace: float = np.inf) -> None:
        self.seconds, self.pace = seconds, pace
        self._closing = seconds
        self.shown: State | None = None
        self._time_ns = self._start_ns = 0
        self._gap: _Gap | None = None
        self._torn = False

    @property
    def under_way(self) -> bool:
        """Whether what is shown is not what is computed."""
        return self._torn or self._gap is not None

    def tear(self) -> None:
        """The next state may be far from what is shown."""
        self._torn = True

    def skip(self, time_ns: int) -> None:
        """Nothing was shown until now, whatever the clock says: closing goes on from here."""
        self._start_ns += time_ns - self._time_ns
        self._time_ns = time_ns

    def __call__(self, linear: Float, positions: Float, time_ns: int) -> State:
        """What to show of a computed state."""
        if self._torn and self.shown is not None and self.seconds > 0:
            self._gap, self._start_ns = _gap(self.shown, (linear, positions)), self._time_ns
            self._closing = max(self.seconds, _STEEPEST * _width(self.shown[1], positions) / self.pace)
        self._torn, self._time_ns = False, time_ns
        share = (time_ns - self._start_ns) * 1e-9 / max(self._closing, 1e-9)
        if self._gap is None or not 0.0 <= share < 1.0:
            self._gap, self.shown = None, (linear, positions)
        else:
            left = 1.0 - share * share * (3 - 2 * share)
            self.shown = _apart(self._gap, left, linear, positions)
        return self.shown


def _width(shown: Float, new: Float) -> float:
    """Metres of the way of the whole and the farthest way within it, which may go after one another."""
    way = new.mean(0) - shown.mean(0)
    return float(np.linalg.norm(way) + np.linalg.norm(new - shown - way, axis=1).max())


def _gap(shown: State, new: State) -> _Gap:
    """The gap between two states; ``_apart`` with all of it gives ``shown`` again."""
    before, after = shown[1].mean(0), new[1].mean(0)
    a, b = shown[1] - before, new[1] - after
    yaw = yaw_between(b, a)
    growth = float(np.sqrt((a * a).sum() / max((b * b).sum(), 1e-12)))
    growth = growth if 1e-3 < growth < 1e3 else 1.0
    back = turn_about_y(-yaw) / growth
    return _Gap(yaw, float(np.log(growth)), before - after, back @ shown[0] - new[0], a @ back.T - b)


def _apart(gap: _Gap, left: float, linear: Float, positions: Float) -> State:
    """The state, with so much of the gap to what was shown."""
    turn = np.exp(left * gap.growth) * turn_about_y(left * gap.yaw)
    centre = positions.mean(0)
    spread = positions - centre + left * gap.positions
    return turn @ (linear + left * gap.linear), spread @ turn.T + centre + left * gap.way
