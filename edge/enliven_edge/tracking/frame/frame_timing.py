"""The times of a sensor's frames: in order, often enough, none missing."""

from __future__ import annotations

from collections import deque

_REMEMBERED_NS = 1_500_000_000
"""Nanoseconds over which rate and loss are measured: a change shows within two seconds."""
_ENOUGH = 6
"""Steps between frames from which rate and loss are told; a slow sensor keeps so many beyond that time."""
_NEW_CLOCK = 3
"""Frames in a row from the past, in order among themselves, that tell of a clock set back: fewer are late."""
_LONGEST_STEP_NS = 2_000_000_000
"""Nanoseconds: a longer step is a pause of the stream, not frames that were lost."""


class FrameTiming:
    """Judges frames by their times: in order or not, at which rate, how many are missing.

    Attributes:
        late: frames that came out of order so far; the caller drops them.
        repeated: frames in a row with the time of the frame before.
    """

    def __init__(self) -> None:
        self.late = 0
        self.repeated = 0
        self._newest: int | None = None
        self._behind: deque[int] = deque(maxlen=_NEW_CLOCK)
        self._steps: deque[int] = deque()
        self._rate: float | None = None
        self._lost = 0.0

    def admit(self, time_ns: int) -> bool:
        """Whether a frame is newer than all before, or the first of a clock that was set back."""
        newest = self._newest
        if newest is not None and time_ns == newest:
            self.repeated += 1
            return False
        if newest is not None and time_ns < newest and not self._set_back(time_ns):
            self.late += 1
            return False
        if newest is None or not 0 < time_ns - newest < _LONGEST_STEP_NS:
            self._steps.clear()
        else:
            self._steps.append(time_ns - newest)
        self.repeated = 0
        self._behind.clear()
        self._newest = time_ns
        self._measure()
        return True

    @property
    def rate(self) -> float | None:
        """Frames a second by the sensor's own clock, over the last 1.5 s; None before there are enough."""
        return self._rate

    @property
    def lost(self) -> float:
        """The share of the frames that seem to be missing between those that came."""
        return self._lost

    def _set_back(self, time_ns: int) -> bool:
        """Whether the clock starts anew: several frames from the past, one after the other."""
        if self._behind and time_ns <= self._behind[-1]:
            self._behind.clear()
        self._behind.append(time_ns)
        return len(self._behind) == _NEW_CLOCK

    def _measure(self) -> None:
        """Rate and loss over the last frames."""
        while len(self._steps) > _ENOUGH and sum(self._steps) > _REMEMBERED_NS:
            self._steps.popleft()
        count = len(self._steps)
        if count < _ENOUGH:
            self._rate, self._lost = None, 0.0
            return
        ordered = sorted(self._steps)
        self._rate = 1e9 * count / sum(ordered)
        # A frame on time follows after the shortest step, were it not for the jitter of the sensor's clock.
        period = ordered[count // 8]
        due = sum(round(step / period) for step in self._steps)
        self._lost = 1.0 - count / max(count, due)
