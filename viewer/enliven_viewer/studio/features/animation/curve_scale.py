"""The vertical scale of the curves: maps values to pixels, and chooses the labelled values."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float

_MARGIN_FRACTION = 0.12
"""Margin above and below, as a fraction of the value range."""
_MIN_VALUE_RANGES = {"\u00b0": 10.0, "m": 0.1, "x": 1.0, "": 1.0}
"""Minimum visible value range, by unit."""
_MIN_LABEL_DISTANCE_PX = 26.0
"""Minimum distance between two labels in pixels."""


@dataclass(frozen=True)
class Scale:
    """A linear scale from the value ``low`` at the bottom to ``high`` at the top of an area of ``height``
    pixels.
    """

    low: float
    high: float
    height: float

    @staticmethod
    def fit_values(values: Float, unit: str, height: float) -> Scale:
        """Returns the scale that shows all given values."""
        finite = values[np.isfinite(values)]
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
        width = max(high - low, _MIN_VALUE_RANGES.get(unit, 1.0))
        middle = (low + high) / 2
        half = width * (0.5 + _MARGIN_FRACTION)
        return Scale(middle - half, middle + half, height)

    def y(self, value: float) -> float:
        """Returns the y coordinate of a value, in pixels from the top."""
        return self.height * (self.high - value) / (self.high - self.low)

    def value(self, y: float) -> float:
        """Returns the value at a y coordinate."""
        return self.high - y / self.height * (self.high - self.low)

    def zoom(self, factor: float, y: float) -> Scale:
        """Returns the scale with the range multiplied by ``factor``.

        The value at pixel ``y`` stays in place.
        """
        fixed_value = self.value(y)
        return Scale(
            fixed_value - (fixed_value - self.low) * factor,
            fixed_value + (self.high - fixed_value) * factor,
            self.height,
        )

    def pan(self, pixels: float) -> Scale:
        """Returns the scale with all values panned down by some pixels."""
        shift = pixels / self.height * (self.high - self.low)
        return Scale(self.low + shift, self.high + shift, self.height)

    def ticks(self) -> tuple[float, ...]:
        """Returns round values to label, with a minimum distance in pixels."""
        min_step = (self.high - self.low) * _MIN_LABEL_DISTANCE_PX / self.height
        power_of_ten = 10.0 ** math.floor(math.log10(max(min_step, 1e-12)))
        step = next(
            factor * power_of_ten
            for factor in (1.0, 2.0, 5.0, 10.0)
            if factor * power_of_ten >= min_step * (1 - 1e-9)
        )
        first = math.ceil(self.low / step)
        return tuple(step * k for k in range(first, math.floor(self.high / step) + 1))
