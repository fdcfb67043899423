"""Estimates the offset of an edge's wall clock from this machine's monotonic clock by bursts of probes.

The method is that of Lab Streaming Layer (Stenner et al., "Synchronization and data streams"): NTP's formula
with a minimum filter. Only the probe with the shortest round trip of each burst is used, because it had the
shortest delays. The estimate then moves towards the result at a limited rate, so converted times never
decrease.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

BURST_INTERVAL_S = 2.0
"""Time in seconds from the start of one burst to the start of the next. Two clocks drift by at most 0.2 ms in
this time."""
PROBES_PER_BURST = 8
"""Number of probes in a burst. It is large enough that at least one probe is not delayed by other traffic."""
PROBE_INTERVAL_S = 0.064
"""Time in seconds between the probes of a burst. It is about two frames, so that the probes reach an edge in
different phases of its main loop.
"""
MIN_ANSWERS = 6
"""Minimum number of answers in a burst. With fewer answers, the network is too unreliable for an estimate."""
_ANSWER_TIMEOUT_S = 0.5
"""Time in seconds after the last probe of a burst in which answers are accepted."""
MAX_SLEW = 500e-6
"""Maximum change of the offset, in seconds per second. Quartz clocks drift by less than 0.1 ms per second."""
_MAX_SLEWED_NS = 10_000_000
"""Maximum error in nanoseconds that is removed gradually, within 20 s. A larger error means that a clock was
set, and is removed immediately.
"""
_RECENT_BURSTS = 10
"""Number of recent bursts that a new burst is compared with. They cover 20 s."""
_NS_PER_S = 1_000_000_000
"""Nanoseconds per second. All times in this module are integer nanoseconds."""


@dataclass(frozen=True)
class ClockExchange:
    """The times of a probe and its answer, in nanoseconds. Local times are from the monotonic clock, and the
    edge's times from its wall clock.

    Attributes:
        sent_ns: local time at which the probe was sent.
        arrived_ns: edge time at which the probe arrived.
        answered_ns: edge time of the answer.
        received_ns: local time at which the answer arrived.
    """

    sent_ns: int
    arrived_ns: int
    answered_ns: int
    received_ns: int

    @property
    def round_trip_ns(self) -> int:
        """Time on the network in nanoseconds: the duration of the exchange minus the time that the edge
        needed to answer.
        """
        return (self.received_ns - self.sent_ns) - (self.answered_ns - self.arrived_ns)

    @property
    def offset_ns(self) -> int:
        """Edge time minus local time in nanoseconds. The error is at most half of the round trip."""
        return ((self.arrived_ns - self.sent_ns) + (self.answered_ns - self.received_ns)) // 2


@dataclass(frozen=True)
class _OffsetSlew:
    """An offset that moves gradually from ``start_ns`` to ``end_ns``, beginning at the local time
    ``since_ns``."""

    since_ns: int
    start_ns: int
    end_ns: int

    def compute_offset(self, local_ns: int) -> int:
        """Returns the offset at a local time."""
        limit = round(MAX_SLEW * max(local_ns - self.since_ns, 0))
        return self.start_ns + min(max(self.end_ns - self.start_ns, -limit), limit)


class ClockSync:
    """The estimate of one edge's clock offset, and the schedule of probes.

    It does no I/O and reads no clock. All local times are from ``time.monotonic_ns``, which cannot be set. So
    the offset jumps only if the edge's clock changes. One thread may add exchanges while other threads
    convert times.
    """

    def __init__(self) -> None:
        self._slew: _OffsetSlew | None = None
        self._burst_ns: int | None = None
        self._sent, self._is_finished = 0, False
        self._answers: list[ClockExchange] = []
        self._round_trips: deque[int] = deque(maxlen=_RECENT_BURSTS)
        self.failed_bursts = 0
        """Number of successive bursts with too few answers."""

    @property
    def is_known(self) -> bool:
        """True after the first burst with enough answers."""
        return self._slew is not None

    @property
    def round_trip_ns(self) -> int:
        """The shortest round trip of the recent bursts in nanoseconds. The error is at most half of it."""
        return min(self._round_trips, default=0)

    def offset_ns(self, local_ns: int) -> int:
        """Returns edge time minus local time in nanoseconds, at a local time. Returns 0 if the offset is not
        known yet."""
        return 0 if self._slew is None else self._slew.compute_offset(local_ns)

    def take_due_probe(self, local_ns: int) -> bool:
        """Returns True if a probe must be sent now, and counts this probe. Also ends a burst when its time is
        over."""
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
        """Returns the local time at which :meth:`take_due_probe` must be called next."""
        if self._burst_ns is None:
            return local_ns
        if self._sent < PROBES_PER_BURST:
            return self._burst_ns + self._sent * round(PROBE_INTERVAL_S * _NS_PER_S)
        if not self._is_finished:
            return self._end_ns(self._burst_ns)
        return self._burst_ns + round(BURST_INTERVAL_S * _NS_PER_S)

    def add(self, exchange: ClockExchange) -> None:
        """Adds an exchange. An impossible exchange, with an answer earlier than its probe, is dropped."""
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
        """Ends a burst, and updates the estimate from its answers. A second call does nothing."""
        answers, self._answers = self._answers, []
        if len(answers) >= MIN_ANSWERS:
            self.failed_bursts = 0
            self._apply_exchange(min(answers, key=lambda a: a.round_trip_ns), now_ns)
        elif not self._is_finished:
            self.failed_bursts += 1
        self._is_finished = True

    def _apply_exchange(self, best: ClockExchange, now: int) -> None:
        """Moves the offset towards the best exchange of a burst, from now on."""
        round_trip = best.round_trip_ns
        self._round_trips.append(round_trip)
        if self._slew is None:
            self._slew = _OffsetSlew(now, best.offset_ns, best.offset_ns)
            return
        current = self._slew.compute_offset(now)
        error = best.offset_ns - current
        if abs(error) > max(_MAX_SLEWED_NS, round_trip // 2):
            # The old offset is outside the possible range, so one of the clocks was set.
            self._round_trips.clear()
            self._round_trips.append(round_trip)
            self._slew = _OffsetSlew(now, best.offset_ns, best.offset_ns)
            return
        # A burst with long round trips has a larger error, so it gets a lower weight.
        weight = max(min(self._round_trips), 1) / max(round_trip, 1)
        self._slew = _OffsetSlew(now, current, current + round(weight * error))
