"""Easing (blending) that keeps the shown state continuous when the computed state jumps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.possession.placement import rotation_about_y, yaw_between

_MAX_SLOPE = 1.5 * np.pi / 2
"""Maximum slope of the cubic easing (1.5, at its middle) times pi / 2, the ratio of arc to chord of a half
turn."""

State = tuple[Float, Float]
"""(N, 3, 3) linear parts and (N, 3) positions, world frame."""


@dataclass(frozen=True)
class _Gap:
    """The difference from the computed state to the shown one: a similarity transform, and a residual per
    node.

    Attributes:
        yaw: radians about +Y of the whole.
        growth: natural logarithm of the scale of the whole.
        offset: (3,) metres between the centres.
        linear, positions: (N, 3, 3) and (N, 3) residuals in the frame of the computed state.
    """

    yaw: float
    growth: float
    offset: Float
    linear: Float
    positions: Float


class PoseBlend:
    """A blend over a jump: keeps the gap between the shown and the computed state, and closes it over time.

    While a gap closes, the shown speed of a node exceeds its computed speed by at most ``pace``, and by at
    most 1.5 / seconds times the length of the gap. The rotation and scale of the gap itself are not counted.
    If the gap is a rotation, its length counts pi / 2 times.

    Args:
        seconds: how long a gap takes to close.
        pace: metres per second; a gap that is too wide for this speed takes longer.
    """

    def __init__(self, seconds: float, pace: float = np.inf) -> None:
        self.seconds, self.pace = seconds, pace
        self._closing = seconds
        self.shown: State | None = None
        self._time_ns = self._start_ns = 0
        self._gap: _Gap | None = None
        self._restarts = False

    @property
    def is_active(self) -> bool:
        """True if the shown state differs from the computed state."""
        return self._restarts or self._gap is not None

    def restart(self) -> None:
        """Discards the shown state, so that the next computed state is shown without easing."""
        self.shown, self._gap, self._restarts = None, None, False

    def turn_along(self, yaw: float) -> None:
        """Rotates the last shown state by ``yaw`` radians about +Y if a fade restarts in this frame. The fade
        then begins from the rotated state. Without this a spinning mesh would lag by one frame's turn.
        """
        if self._restarts and self.shown is not None:
            (linear, positions), turn = self.shown, rotation_about_y(yaw)
            centre = positions.mean(0)
            self.shown = turn @ linear, (positions - centre) @ turn.T + centre

    def restart_fade(self) -> None:
        """Eases from the shown state to the next computed state, even if they are far apart."""
        self._restarts = True

    def skip(self, time_ns: int) -> None:
        """Excludes the time since the last state, in which nothing was shown, from the fade, and continues
        the fade.
        """
        self._start_ns += time_ns - self._time_ns
        self._time_ns = time_ns

    def __call__(self, linear: Float, positions: Float, time_ns: int) -> State:
        """Returns the state to show for a computed state: (N, 3, 3) linear parts and (N, 3) positions."""
        if self._restarts and self.shown is not None and self.seconds > 0:
            self._gap, self._start_ns = _gap_between(self.shown, (linear, positions)), self._time_ns
            self._closing = max(self.seconds, _MAX_SLOPE * _gap_width(self.shown[1], positions) / self.pace)
        self._restarts, self._time_ns = False, time_ns
        share = (time_ns - self._start_ns) * 1e-9 / max(self._closing, 1e-9)
        if self._gap is None or not 0.0 <= share < 1.0:
            self._gap, self.shown = None, (linear, positions)
        else:
            remaining = 1.0 - share * share * (3 - 2 * share)
            self.shown = _state_across_gap(self._gap, remaining, linear, positions)
        return self.shown


def _gap_width(shown: Float, new: Float) -> float:
    """Returns the distance between the centres plus the largest displacement of a node relative to its
    centre, metres.
    """
    offset = new.mean(0) - shown.mean(0)
    return float(np.linalg.norm(offset) + np.linalg.norm(new - shown - offset, axis=1).max())


def _gap_between(shown: State, new: State) -> _Gap:
    """Returns the gap between two states. ``_state_across_gap`` with ``left`` = 1 reproduces ``shown``."""
    before, after = shown[1].mean(0), new[1].mean(0)
    a, b = shown[1] - before, new[1] - after
    yaw = yaw_between(b, a)
    growth = float(np.sqrt((a * a).sum() / max((b * b).sum(), 1e-12)))
    growth = growth if 1e-3 < growth < 1e3 else 1.0
    back = rotation_about_y(-yaw) / growth
    return _Gap(yaw, float(np.log(growth)), before - after, back @ shown[0] - new[0], a @ back.T - b)


def _state_across_gap(gap: _Gap, left: float, linear: Float, positions: Float) -> State:
    """Returns the computed state plus the fraction ``left`` of the gap."""
    turn = np.exp(left * gap.growth) * rotation_about_y(left * gap.yaw)
    centre = positions.mean(0)
    spread = positions - centre + left * gap.positions
    return turn @ (linear + left * gap.linear), spread @ turn.T + centre + left * gap.offset
