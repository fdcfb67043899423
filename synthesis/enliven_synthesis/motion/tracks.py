"""Time curves: keyframes with smooth splines, steps of the feet, and pulses."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator


class Track:
    """A number over time, interpolated between keyframes.

    It is constant before the first keyframe and after the last.

    The interpolation is monotone cubic (Fritsch and Carlson 1980): it is flat at extremes and never
    overshoots them.
    """

    def __init__(self, *keys: tuple[float, float]) -> None:
        self._only = keys[0][1]
        times, values = np.array(keys, dtype=np.float64).T
        self._first, self._last = float(times[0]), float(times[-1])
        self._spline = PchipInterpolator(times, values) if len(keys) > 1 else None

    def __call__(self, time: float) -> float:
        """Returns the value at ``time`` seconds."""
        if self._spline is None:
            return self._only
        return float(self._spline(min(max(time, self._first), self._last)))


def ease(t: float) -> float:
    """Returns minimum-jerk progress from 0 at t <= 0 to 1 at t >= 1 (Flash and Hogan 1985)."""
    t = min(max(t, 0.0), 1.0)
    # Clamp the result, because rounding errors may make it slightly larger than 1.
    return min(t * t * t * (10.0 - 15.0 * t + 6.0 * t * t), 1.0)


def smooth_pulse(time: float, start: float, stop: float, rise: float) -> float:
    """Returns a pulse: 1 from ``start`` to ``stop``, and 0 outside.

    The transitions are eased over ``rise`` seconds, before ``start`` and after ``stop``.
    """
    return ease((time - start) / rise + 1.0) * (1.0 - ease((time - stop) / rise))


def sway(time: float, duration: float, cycles: int, phase: float) -> float:
    """Returns a sine with a whole number of cycles in ``duration`` seconds, so that a choreography can
    loop.
    """
    return math.sin(2.0 * math.pi * (cycles * time / duration + phase))


@dataclass(frozen=True)
class Step:
    """One step of one foot, from leaving the floor to touching it.

    Attributes:
        foot: 0 for the left, 1 for the right.
        start, stop: times in seconds at which it leaves and touches the floor.
        dx, dz: displacement of the foot in metres.
        lift: height of the ball in metres at the middle of the step.
        toe: angle in radians of the hanging toes at the middle of the step.
        arc: (x, z) sideways swing of the foot in metres at the middle of the step.
        both: True for a hop, in which the pelvis rises with the foot and does not shift onto the other foot.
    """

    foot: int
    start: float
    stop: float
    dx: float = 0.0
    dz: float = 0.0
    lift: float = 0.1
    toe: float = 0.3
    arc: tuple[float, float] = (0.0, 0.0)
    both: bool = False

    def progress(self, time: float) -> float:
        """Returns 0 before the step, 1 after it, and a minimum-jerk curve in between."""
        return ease((time - self.start) / (self.stop - self.start))

    def height(self, time: float) -> float:
        """Returns the height of the ball above its planted height in metres.

        Only a hop starts and ends with a vertical speed.
        """
        bump = self._parabola(time)
        return self.lift * (bump if self.both else bump * bump)

    def offset(self, time: float) -> tuple[float, float]:
        """Returns the current (x, z) displacement of the foot in metres."""
        s, bump = self.progress(time), self._parabola(time) ** 2
        return s * self.dx + bump * self.arc[0], s * self.dz + bump * self.arc[1]

    def _parabola(self, time: float) -> float:
        """Returns a parabola over the step: 1 at its middle, and 0 before and after it."""
        s = (time - self.start) / (self.stop - self.start)
        return 4.0 * s * (1.0 - s) if 0.0 < s < 1.0 else 0.0
