"""Blending that keeps the displayed state continuous when the computed state jumps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.possession.placement import rotation_about_y, yaw_between

_MAX_SLOPE = 1.5 * np.pi / 2
"""Maximum slope of the cubic easing (1.5, at its middle), times the ratio of arc to chord of a half turn (pi
/ 2)."""

State = tuple[Float, Float]
"""(N, 3, 3) linear parts and (N, 3) positions of nodes."""


@dataclass(frozen=True)
class _Gap:
    """The difference between the computed and the displayed state: a similarity transform, and a residual per
    node.

    Attributes:
        yaw: rotation of the whole mesh about +Y, radians.
        growth: natural logarithm of the scale of the whole mesh.
        offset: (3,) offset between the centres, metres.
        linear, positions: (N, 3, 3) and (N, 3) residuals in the frame of the computed state.
    """

    yaw: float
    growth: float
    offset: Float
    linear: Float
    positions: Float


class PoseBlend:
    """A blend over a jump. It stores the gap between the displayed and the computed state, and closes the gap
    over time.

    While a gap closes, the displayed speed of a node exceeds its computed speed by at most ``pace``. It also
    exceeds it by at most 1.5 / seconds times the length of the gap. The length does not include the rotation
    and scale of the whole mesh. For the rotation of a node it is multiplied by pi / 2.

    Args:
        seconds: duration in which a gap closes.
        pace: maximum speed of closing, metres per second. A wide gap takes longer than ``seconds``.
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
        """Rotates the last displayed state by ``yaw`` radians about +Y if a fade restarts in this frame. The
        fade then begins from the rotated state, so a spinning mesh does not lag by the rotation of one frame.
        """
        if self._restarts and self.shown is not None:
            (linear, positions), rotation_matrix = self.shown, rotation_about_y(yaw)
            centre = positions.mean(0)
            self.shown = rotation_matrix @ linear, (positions - centre) @ rotation_matrix.T + centre

    def restart_fade(self) -> None:
        """Restarts the fade: eases from the displayed state to the next computed state, even if they are far
        apart.
        """
        self._restarts = True

    def skip(self, time_ns: int) -> None:
        """Pauses the fade from the last displayed state until ``time_ns``, because nothing was displayed in
        that time.
        """
        self._start_ns += time_ns - self._time_ns
        self._time_ns = time_ns

    def __call__(self, linear: Float, positions: Float, time_ns: int) -> State:
        """Returns the state to show for a computed state: (N, 3, 3) linear parts and (N, 3) positions."""
        if self._restarts and self.shown is not None and self.seconds > 0:
            self._gap, self._start_ns = _gap_between(self.shown, (linear, positions)), self._time_ns
            self._closing = max(self.seconds, _MAX_SLOPE * _gap_width(self.shown[1], positions) / self.pace)
        self._restarts, self._time_ns = False, time_ns
        fraction = (time_ns - self._start_ns) * 1e-9 / max(self._closing, 1e-9)
        if self._gap is None or not 0.0 <= fraction < 1.0:
            self._gap, self.shown = None, (linear, positions)
        else:
            remaining = 1.0 - fraction * fraction * (3 - 2 * fraction)
            self.shown = _state_across_gap(self._gap, remaining, linear, positions)
        return self.shown


def _gap_width(shown: Float, new: Float) -> float:
    """Returns the distance between the centres plus the largest displacement of a node relative to its
    centre, metres.
    """
    offset = new.mean(0) - shown.mean(0)
    return float(np.linalg.norm(offset) + np.linalg.norm(new - shown - offset, axis=1).max())


def _gap_between(shown: State, new: State) -> _Gap:
    """Computes the gap between two states. ``_state_across_gap`` with ``left`` = 1 reproduces ``shown``."""
    shown_centre, new_centre = shown[1].mean(0), new[1].mean(0)
    a, b = shown[1] - shown_centre, new[1] - new_centre
    yaw = yaw_between(b, a)
    growth = float(np.sqrt((a * a).sum() / max((b * b).sum(), 1e-12)))
    growth = growth if 1e-3 < growth < 1e3 else 1.0
    inverse_similarity = rotation_about_y(-yaw) / growth
    return _Gap(
        yaw,
        float(np.log(growth)),
        shown_centre - new_centre,
        inverse_similarity @ shown[0] - new[0],
        a @ inverse_similarity.T - b,
    )


def _state_across_gap(gap: _Gap, left: float, linear: Float, positions: Float) -> State:
    """Returns the computed state with the fraction ``left`` (0 to 1) of the gap applied."""
    similarity = np.exp(left * gap.growth) * rotation_about_y(left * gap.yaw)
    centre = positions.mean(0)
    relative = positions - centre + left * gap.positions
    return similarity @ (linear + left * gap.linear), relative @ similarity.T + centre + left * gap.offset
