"""The scale of values of the curves: which value is at which pixel, and numbers to write beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float

_ROOM = 0.12
"""Share of the values' range that is left free above and below."""
_LEAST = {"\u00b0": 10.0, "m": 0.1, "x": 1.0, "": 1.0}
"""Range of values that is shown at least, by the unit."""
_APART = 26.0
"""Pixels between two numbers at least."""


@dataclass(frozen=True)
class Scale:
    """The values from ``low`` at the bottom to ``high`` at the top of an area of some pixels height."""

    low: float
    high: float
    height: float

    @staticmethod
    def around(values: Float, unit: str, height: float) -> Scale:
        """Returns the scale that shows all of some values."""
        known = values[np.isfinite(values)]
        low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
        wide = max(high - low, _LEAST.get(unit, 1.0))
        middle = (low + high) / 2
        half = wide * (0.5 + _ROOM)
        return Scale(middle - half, middle + half, height)

    def y(self, value: float) -> float:
        """Returns the pixel of a value, from the top."""
        return self.height * (self.high - value) / (self.high - self.low)

    def value(self, y: float) -> float:
        """Returns the value of a pixel."""
        return self.high - y / self.height * (self.high - self.low)

    def zoomed(self, factor: float, y: float) -> Scale:
        """Returns the scale with a range ``factor`` times as wide; the value at a pixel stays there."""
        at = self.value(y)
        return Scale(at - (at - self.low) * factor, at + (self.high - at) * factor, self.height)

    def panned(self, pixels: float) -> Scale:
        """Returns the scale with everything moved down by some pixels."""
        by = pixels / self.height * (self.high - self.low)
        return Scale(self.low + by, self.high + by, self.height)

    def ticks(self) -> tuple[float, ...]:
        """Round values to write, no nearer than some pixels to one another."""
        wanted = (self.high - self.low) * _APART / self.height
        ten = 10.0 ** math.floor(math.log10(max(wanted, 1e-12)))
        step = next(one * ten for one in (1.0, 2.0, 5.0, 10.0) if one * ten >= wanted * (1 - 1e-9))
        first = math.ceil(self.low / step)
        return tuple(step * k for k in range(first, math.floor(self.high / step) + 1))
