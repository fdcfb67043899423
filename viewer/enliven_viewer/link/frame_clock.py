"""Converts the times of an edge's sensor to this machine's monotonic clock.

The clocks of two sensors start at different times. Each edge stamps its messages with the
sensor's time and with its wall clock, and probes measure that wall clock (:mod:`enliven.peers`).
"""

from __future__ import annotations

from collections import deque

_WINDOW = 60
"""Number of frames in the window of the minimum filter: two seconds. In this time the clocks drift by less
than 0.2 ms.
"""
_MAX_STEP_NS = 100_000_000
"""A larger change of the offset in nanoseconds means that a clock was set. Frames are delayed by less."""


class FrameClock:
    """The offset between the sensor's clock and the wall clock of one edge.

    The delay between capturing and reading a frame varies. So the smallest difference of the recent frames is
    used.
    """

    def __init__(self) -> None:
        self._differences: deque[int] = deque(maxlen=_WINDOW)

    @property
    def is_known(self) -> bool:
        """Returns True after the first frame."""
        return bool(self._differences)

    def add(self, sensor_ns: int, captured_ns: int) -> None:
        """Adds a frame: its time on the sensor's clock, and the time on the edge's wall clock when it was
        read.
        """
        if captured_ns <= 0:
            return  # The message belongs to no frame, or its edge sends no capture times.
        difference = captured_ns - sensor_ns
        if self._differences and abs(difference - self._differences[-1]) > _MAX_STEP_NS:
            self._differences.clear()
        self._differences.append(difference)

    def local_ns(self, sensor_ns: int, edge_offset_ns: int) -> int:
        """Converts a time of the sensor's clock to this machine's monotonic clock.

        Args:
            edge_offset_ns: the edge's wall clock minus this machine's monotonic clock.
        """
        return sensor_ns + min(self._differences) - edge_offset_ns
