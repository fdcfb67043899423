"""The times of a sensor's frames: in order, often enough, none missing."""

from __future__ import annotations

from collections import deque

_REMEMBERED_NS = 1_500_000_000
_ENOUGH = 6
_LONGEST_LATE_NS = 1_000_000_000
_NEW_CLOCK = 3
"""So many frames in a row from the past, in order among themselves, are a clock that was set back."""
_LONGEST_STEP_NS = 2_000_000_000


class FrameTiming:
    """Judges frames by their times.

    Attributes:
        late: frames that came out of order so far, and were to be dropped.
        repeated: frames in a row whose time was that of the frame before.
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
        # What comes on time is the shortest step, but for a sensor whose clock trembles.
        period = ordered[count // 8]
        due = sum(round(step / period) for step in self._steps)
        self._lost = 1.0 - count / max(count, due)
