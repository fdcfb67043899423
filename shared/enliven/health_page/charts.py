"""Draws small charts of the last day as SVG. They contain no untrusted text, and no styles that the Content
Security Policy blocks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

WIDTH = 240
"""Width of the drawing area in SVG units. There is one data point per unit, for six minutes."""
HEIGHT = 40
"""Height of the drawing area in SVG units."""
_MARGIN = 2.0
"""Distance of the curve from the lower and upper edge in SVG units, so that its stroke is not cut off."""


@dataclass(frozen=True)
class Chart:
    """A chart of one measured value.

    Attributes:
        title: name of the measured value.
        unit: unit of the value, such as "ms", or empty.
        path: the curve as an SVG path, with a move command at each gap. Empty without values.
        low: smallest value.
        high: largest value.
        last: newest value, or NaN if the newest interval has no value.
    """

    title: str
    unit: str
    path: str
    low: float
    high: float
    last: float


def draw_chart(title: str, unit: str, values: Sequence[float]) -> Chart:
    """Returns the chart of a series of values, the oldest first. NaN causes a gap.

    The vertical axis starts at 0 for values that are never negative.
    """
    finite = [value for value in values if math.isfinite(value)]
    if not finite:
        return Chart(title, unit, "", math.nan, math.nan, math.nan)
    low, high = min(finite), max(finite)
    bottom = min(low, 0.0)
    scale = (HEIGHT - 2 * _MARGIN) / (high - bottom) if high > bottom else 0.0
    step = WIDTH / max(len(values), 1)
    commands, is_drawing = [], False
    for number, value in enumerate(values):
        if not math.isfinite(value):
            is_drawing = False
            continue
        x, y = number * step, HEIGHT - _MARGIN - (value - bottom) * scale
        # Draw a single value between two gaps as a line of one unit, since a point would be invisible.
        commands.append(f"{'L' if is_drawing else 'M'}{x:.1f} {y:.1f}H{x + step:.1f}")
        is_drawing = True
    return Chart(title, unit, "".join(commands), low, high, values[-1])
