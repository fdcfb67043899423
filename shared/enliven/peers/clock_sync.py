"""Estimates the offset of an edge's wall clock from this machine's monotonic clock by bursts of probes.

The method is that of Lab Streaming Layer (Stenner et al., "Synchronization and data streams"), which is NTP's
formula with a minimum filter: of each burst only the probe with the shortest round trip counts, because it
had the shortest delays. The estimate then moves towards the result at a bounded rate, so converted times
never decrease.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

BURST_INTERVAL_S = 2.0
"""Seconds from the start of one burst to the next. Two clocks drift by 0.2 ms at most in this time."""
PROBES_PER_BURST = 8
"""Number of probes in a burst: enough that at least one is not delayed by other traffic."""
PROBE_INTERVAL_S = 0.064
"""Seconds between the probes of a burst: about two frames, so that they reach an edge in different phases of
its loop.
"""
MIN_ANSWERS = 6
"""Minimum number of answers in a burst. With fewer, the network is too disturbed for an estimate."""
_ANSWER_TIMEOUT_S = 0.5
"""Seconds after the last probe of a burst during which answers still count."""
MAX_SLEW = 500e-6
"""Maximum change of the offset, in seconds per second. Quartz clocks drift by less than 0.1 ms per second."""
_MAX_SLEWED_NS = 10_000_000
"""Largest error in nanoseconds that is removed gradually, which takes 20 s. A larger error means that a clock
was set.
"""
_RECENT_BURSTS = 10
"""Number of recent bursts that are compared with a new one: 20 s."""
_NS_PER_S = 1_000_000_000
"""Nanoseconds per second. All times in this module are integer nanoseconds."""


@dataclass(frozen=True)
class Exchange:
    """A probe and its answer, in nanoseconds. Local times are of the monotonic clock, the edge's times of its
    wall clock.

    Attributes:
        sent_ns: when this side sent the probe.
        arrived_ns: when it arrived at the edge.
        answered_ns: when the edge answered.
        received_ns: when the answer arrived here.
    """

    sent_ns: int
    arrived_ns: int
    answered_ns: int
    received_ns: int

    @property
    def round_trip_ns(self) -> int:
        """Time on the network in nanoseconds: the whole duration minus the time that the edge needed to
        answer.
        """
        return (self.received_ns - self.sent_ns) - (self.answered_ns - self.arrived_ns)

    @property
    def offset_ns(self) -> int:
        """Edge time minus local time in nanoseconds. The error is at most half of the round trip."""
        return ((self.arrived_ns - self.sent_ns) + (self.answered_ns - self.received_ns)) // 2


@dataclass(frozen=True)
class _Slew:
    """An offset that moves from ``start_ns`` to ``end_ns``, beginning at the local time ``since_ns``."""

    since_ns: int
    start_ns: int
    end_ns: int

    def at(self, local_ns: int) -> int:
        """Returns the offset at a local time."""
        limit = round(MAX_SLEW * max(local_ns - self.since_ns, 0))
        return self.start_ns + min(max(self.end_ns - self.start_ns, -limit), limit)


class ClockSync:
    """The clock of one edge: when to send probes, and the offset from their answers.

    It opens no socket and reads no clock. All local times are those of ``time.monotonic_ns``, which cannot be
    set. So only a change of the edge's clock makes the offset jump. One thread may add exchanges while others
    convert times.
    """

    def __init__(self) -> None:
        self._slew: _Slew | None = None
        self._burst_ns: int | None = None
        self._sent, self._is_finished = 0, False
        self._answers: list[Exchange] = []
        self._round_trips: deque[int] = deque(maxlen=_RECENT_BURSTS)
        self.failed_bursts = 0
        """Number of bursts without enough answers since the last one with enough."""

    @property
    def is_known(self) -> bool:
        """True after the first burst with enough answers."""
        return self._slew is not None

    @property
    def round_trip_ns(self) -> int:
        """The shortest round trip of the recent bursts in nanoseconds. The error is at most half of it."""
        return min(self._round_trips, default=0)

    def offset_ns(self, local_ns: int) -> int:
        """Returns edge time minus local time in nanoseconds, at a local time. 0 if it is not known yet."""
        return 0 if self._slew is None else self._slew.at(local_ns)

    def probes_due(self, local_ns: int) -> bool:
        """Returns True if a probe must be sent now, and counts it. Ends a burst after its time."""
        if self._burst_ns is None:
            self._burst_ns = local_ns
        if self._sent < PROBES_PER_BURST:
            due = local_ns >= self._burst_ns + self._sent * round(PROBE_INTERVAL_S * _NS_PER_S)
            self._sent += due
            return due
        if local_ns >= self._end_ns(self._burst_ns):
            self._finish_burst(local_ns)
        if local_ns >= self._burst_ns + round(BURST_INTERVAL_S * _NS_PER_S):
            self._burst_ns, self._sent, self._is_finished = local_ns, 1, False
            return True
        return False

    def next_due_ns(self, local_ns: int) -> int:
        """Returns the local time at which :meth:`probes_due` must be called next."""
        if self._burst_ns is None:
            return local_ns
        if self._sent < PROBES_PER_BURST:
            return self._burst_ns + self._sent * round(PROBE_INTERVAL_S * _NS_PER_S)
        if not self._is_finished:
            return self._end_ns(self._burst_ns)
        return self._burst_ns + round(BURST_INTERVAL_S * _NS_PER_S)

    def add(self, exchange: Exchange) -> None:
        """Adds an answer. An answer that was sent before its probe is impossible and is dropped."""
        is_current = self._burst_ns is not None and exchange.sent_ns >= self._burst_ns
        if not is_current or exchange.round_trip_ns < 0 or exchange.answered_ns < exchange.arrived_ns:
            return
        self._answers.append(exchange)
        if len(self._answers) == PROBES_PER_BURST:
            self._finish_burst(exchange.received_ns)

    def _end_ns(self, burst_ns: int) -> int:
        """Returns the local time at which a burst ends if answers are missing."""
        seconds = (PROBES_PER_BURST - 1) * PROBE_INTERVAL_S + _ANSWER_TIMEOUT_S
        return burst_ns + round(seconds * _NS_PER_S)

    def _finish_burst(self, now_ns: int) -> None:
        """Uses the answers of a burst. A second call does nothing."""
        answers, self._answers = self._answers, []
        if len(answers) >= MIN_ANSWERS:
            self.failed_bursts = 0
            self._use(min(answers, key=lambda a: a.round_trip_ns), now_ns)
        elif not self._is_finished:
            self.failed_bursts += 1
        self._is_finished = True

    def _use(self, best: Exchange, now: int) -> None:
        """Moves the offset towards the best exchange of a burst, from now on."""
        round_trip = best.round_trip_ns
        self._round_trips.append(round_trip)
        if self._slew is None:
            self._slew = _Slew(now, best.offset_ns, best.offset_ns)
            return
        current = self._slew.at(now)
        error = best.offset_ns - current
        if abs(error) > max(_MAX_SLEWED_NS, round_trip // 2):
            # The old offset is outside of the possible range, so one of the clocks was set.
            self._round_trips.clear()
            self._round_trips.append(round_trip)
            self._slew = _Slew(now, best.offset_ns, best.offset_ns)
            return
        # A burst with long round trips has a larger error, so it counts less.
        weight = max(min(self._round_trips), 1) / max(round_trip, 1)
        self._slew = _Slew(now, current, current + round(weight * error))
