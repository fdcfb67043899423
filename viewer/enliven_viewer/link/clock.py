"""Estimates the offset between an edge's wall clock and this machine's, to measure latency across machines.

A request is sent at time s, answered at time e on the edge's clock, and the answer arrives at time r. Then
the offset lies between e - r and e - s, since nothing arrives before it was sent. Every heartbeat adds a
lower bound. The bounds of different messages are intersected (Marzullo, "Maintaining the time in a
distributed system", 1984). This is tighter than using the single message with the smallest round trip: each
program reads its socket only once per frame, and this delay affects either direction at random.
"""

from __future__ import annotations

from collections import deque

_MAX_BOUNDS = 64
"""Maximum number of stored lower bounds and of stored upper bounds. They cover about a minute, in which
clocks drift by a few milliseconds at most.
"""


class ClockEstimate:
    """The clock offset of one edge. Added to a time of this machine's clock, it gives the edge's time."""

    def __init__(self) -> None:
        self._upper: deque[int] = deque(maxlen=_MAX_BOUNDS)
        self._lower: deque[int] = deque(maxlen=_MAX_BOUNDS)

    def add_ping(self, sent_ns: int, edge_ns: int, received_ns: int) -> None:
        """Adds the answer to a ping: local times of sending and receiving, and the edge's time stamp."""
        if received_ns >= sent_ns:
            self._upper.append(edge_ns - sent_ns)
            self._lower.append(edge_ns - received_ns)
            self._drop_contradictions()

    def add_heartbeat(self, edge_ns: int, received_ns: int) -> None:
        """Adds a heartbeat: the edge's time stamp, and the local time of its arrival."""
        self._lower.append(edge_ns - received_ns)
        self._drop_contradictions()

    @property
    def is_known(self) -> bool:
        """Returns True if both a lower and an upper bound of the offset are known."""
        return bool(self._upper)

    @property
    def offset_ns(self) -> int:
        """Returns the offset in nanoseconds: the middle of the possible range.

        Returns 0 if 0 is in that range, or nothing is known.
        """
        if not self.is_known:
            return 0
        low, high = max(self._lower), min(self._upper)
        return 0 if low <= 0 <= high else (low + high) // 2

    def _drop_contradictions(self) -> None:
        """Keeps only the newest bounds if the bounds contradict each other, because then a clock was set."""
        if self._upper and self._lower and max(self._lower) > min(self._upper):
            upper, lower = self._upper[-1], self._lower[-1]
            self._upper.clear()
            self._lower.clear()
            if lower <= upper:
                self._upper.append(upper)
                self._lower.append(lower)
