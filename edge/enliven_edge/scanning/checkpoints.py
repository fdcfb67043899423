"""Earlier states of a scan, to which it can go back."""

from __future__ import annotations

import copy
from collections import deque
from typing import Generic, TypeVar

_EVERY = 2.0
"""Seconds of the sensor's clock between two states that are kept."""
_KEPT = 3
"""States that are kept: six seconds, in which a mistake is noticed."""
_MEGABYTES = 1200.0
"""Of the states together; of a scan that is larger fewer are kept, and at last none."""

State = TypeVar("State")


class Checkpoints(Generic[State]):
    """Copies of the newest states, the oldest first."""

    def __init__(self) -> None:
        self._kept: deque[tuple[int, State]] = deque()

    def offer(self, state: State, time_ns: int, megabytes: float) -> None:
        """Keep a copy of a state, where the newest copy is old enough and there is memory."""
        most = min(_KEPT, int(_MEGABYTES / max(megabytes, 1e-9)))
        newest = self._kept[-1][0] if self._kept else None
        if newest is not None and 0 <= time_ns - newest < _EVERY * 1e9:
            return
        while len(self._kept) >= max(most, 1):
            self._kept.popleft()
        if most:
            self._kept.append((time_ns, copy.deepcopy(state)))

    def seconds(self, now_ns: int) -> float:
        """Returns how many seconds :meth:`back` would take back; 0 where nothing is kept."""
        found = self._meant(now_ns)
        return 0.0 if found is None else (now_ns - self._kept[found][0]) * 1e-9

    def back(self, now_ns: int) -> State | None:
        """Returns the state of at least a moment ago, and forgets it and all later ones; None without."""
        found = self._meant(now_ns)
        if found is None:
            return None
        state = self._kept[found][1]
        while len(self._kept) > found:
            self._kept.pop()
        return state

    def _meant(self, now_ns: int) -> int | None:
        """Returns which state is gone back to: the newest that is half as old as they lie apart."""
        old = [k for k, (at, _) in enumerate(self._kept) if now_ns - at >= 0.5e9 * _EVERY]
        return old[-1] if old else None
