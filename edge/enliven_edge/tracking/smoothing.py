"""The One-Euro filter (Casiez, Roussel, Vogel 2012) on the joints of one person."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking.settings import SmoothingSettings


class OneEuro:
    """Low-pass whose cut-off rises with speed: still joints are calm, fast joints are on time.

    The joints are filtered as one vector each, so that the result does not depend on the world's axes.
    """

    def __init__(self, settings: SmoothingSettings) -> None:
        self.settings = settings
        self._value: Float | None = None
        self._velocity: Float | None = None
        self._time_ns = 0

    def reset(self) -> None:
        """Forgets the past, as after a jump."""
        self._value = None

    def __call__(self, value: Float, time_ns: int) -> Float:
        """The filtered (20, 3) joints; the input itself where the amount is 0.

        Args:
            value: (20, 3) metres.
            time_ns: the sensor's clock; not after the last call resets the filter.
        """
        seconds = (time_ns - self._time_ns) * 1e-9
        if self.settings.amount == 0.0:
            return value
        if self._value is None or self._velocity is None or not 0.0 < seconds < 1.0:
            self._value, self._velocity, self._time_ns = value.copy(), np.zeros_like(value), time_ns
            return value
        velocity = (value - self._value) / seconds
        self._velocity = self._velocity + _alpha(np.array(1.0), seconds) * (velocity - self._velocity)
        speed = np.linalg.norm(self._velocity, axis=1, keepdims=True)
        cutoff = (self.settings.cutoff + self.settings.speed * speed) / self.settings.amount
        self._value = self._value + _alpha(cutoff, seconds) * (value - self._value)
        self._time_ns = time_ns
        return self._value.copy()


def _alpha(cutoff: Float, seconds: float) -> Float:
    """The smoothing factor of a first-order low-pass, equation (5) of the paper."""
    return np.asarray(1.0 / (1.0 + 1.0 / (2 * np.pi * cutoff * seconds)))
