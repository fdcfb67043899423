"""Measures the edge's frames per second and latency over the last few seconds."""

from __future__ import annotations

from collections import deque

import numpy as np

_WINDOW_FRAMES = 150
"""Number of frames in the statistics: five seconds at 30 Hz, enough for a steady percentile."""


class FrameRate:
    """Statistics over the last 150 frames."""

    def __init__(self) -> None:
        self._latency: deque[float] = deque(maxlen=_WINDOW_FRAMES)
        self._done: deque[int] = deque(maxlen=_WINDOW_FRAMES)

    def add_frame(self, read_ns: int, published_ns: int) -> None:
        """Adds one frame with the times at which it was read and published, nanoseconds of one clock."""
        self._latency.append((published_ns - read_ns) * 1e-6)
        self._done.append(published_ns)

    @property
    def fps(self) -> float:
        """Returns the frames per second, or 0 before the second frame."""
        if len(self._done) < 2 or self._done[-1] == self._done[0]:
            return 0.0
        return (len(self._done) - 1) * 1e9 / (self._done[-1] - self._done[0])

    def latency_ms(self, percent: float) -> float:
        """Returns a percentile of the latency in milliseconds from reading a frame to publishing its pose.

        ``percent`` is between 0 and 100.

        The result is 0 before the first frame.
        """
        return float(np.percentile(self._latency, percent)) if self._latency else 0.0
