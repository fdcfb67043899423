"""Estimates the offset of an edge's wall clock from this machine's, to measure latency across machines.

A request sent at s, answered at e by the edge's clock and back at r puts the offset between e - r and e - s,
since nothing arrives before it was sent; every heartbeat adds a lower bound. The bounds of different messages
are intersected (Marzullo, "Maintaining the time in a distributed system", 1984), which is tighter than the
one message with the smallest round trip: each program looks at its socket only once a frame, and the wait
falls on either way at random.
"""

from __future__ import annotations

from collections import deque

_REMEMBERED = 64
"""Bounds of each side that are kept: about a minute, in which clocks drift by a few milliseconds at most."""


class ClockEstimate:
    """The offset of one edge's clock: add it to a time of this clock to get the edge's."""

    def __init__(self) -> None:
        self._upper: deque[int] = deque(maxlen=_REMEMBERED)
        self._lower: deque[int] = deque(maxlen=_REMEMBERED)

    def answered(self, sent_ns: int, edge_ns: int, received_ns: int) -> None:
        """An answer to a ping: sent and received by this clock, stamped by the edge's."""
        if received_ns >= sent_ns:
            self._upper.append(edge_ns - sent_ns)
            self._lower.append(edge_ns - received_ns)
            self._mend()

    def heard(self, edge_ns: int, received_ns: int) -> None:
        """A heartbeat: stamped by the edge's clock, received by this one."""
        self._lower.append(edge_ns - received_ns)
        self._mend()

    @property
    def known(self) -> bool:
        """Returns True if both bounds have been seen."""
        return bool(self._upper)

    @property
    def offset_ns(self) -> int:
        """Nanoseconds, the middle of the possible offsets; 0 if that is possible, or nothing is known."""
        if not self.known:
            return 0
        low, high = max(self._lower), min(self._upper)
        return 0 if low <= 0 <= high else (low + high) // 2

    def _mend(self) -> None:
        """Bounds that exclude each other mean that a clock was set: only the newest hold."""
        if self._upper and self._lower and max(self._lower) > min(self._upper):
            upper, lower = self._upper[-1], self._lower[-1]
            self._upper.clear()
            self._lower.clear()
            if lower <= upper:
                self._upper.append(upper)
                self._lower.append(lower)
