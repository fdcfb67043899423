"""Computes the moment at which the frames of several edges are drawn: the newest moment that all edges have
sent.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

Key = TypeVar("Key")

MAX_LAG_NS = 250_000_000
"""Maximum time in nanoseconds that frames of a fast edge wait for the frames of a slow edge. Performers would
notice a longer delay.
"""
_MAX_AGE_NS = 1_000_000_000
"""Maximum age in nanoseconds of an edge's newest frame. The other edges do not wait for an edge with an older
frame.
"""
_MAX_FUTURE_NS = 50_000_000
"""Frames with times more than this number of nanoseconds in the future are ignored. They mean that a clock
was set and is not measured yet.
"""


class CommonMoment:
    """The displayed moment, on this machine's monotonic clock. It never decreases."""

    def __init__(self) -> None:
        self._shown_ns: int | None = None

    def find_lags(self, newest: Mapping[Key, int], now_ns: int) -> dict[Key, int]:
        """Returns the delay before each edge's frames are drawn, in nanoseconds.

        Args:
            newest: the time of each edge's newest frame, on this machine's monotonic clock in nanoseconds.
            now_ns: the current time on the same clock.
        """
        usable_times = {
            key: time_ns
            for key, time_ns in newest.items()
            if now_ns - _MAX_AGE_NS <= time_ns <= now_ns + _MAX_FUTURE_NS
        }
        if len(usable_times) < 2:
            self._shown_ns = None
            return dict.fromkeys(newest, 0)
        target = max(min(usable_times.values()), max(usable_times.values()) - MAX_LAG_NS)
        if self._shown_ns is None or target < self._shown_ns - MAX_LAG_NS:
            self._shown_ns = target
        self._shown_ns = shown_ns = max(self._shown_ns, target)
        return {key: max(usable_times[key] - shown_ns, 0) if key in usable_times else 0 for key in newest}
