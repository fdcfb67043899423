"""Checkpoints of a scan: snapshots that "undo" returns to."""

from __future__ import annotations

import copy
from collections import deque
from typing import Generic, TypeVar

_INTERVAL_S = 2.0
"""Seconds of the sensor's clock between two checkpoints."""
_MAX_CHECKPOINTS = 3
"""Maximum number of checkpoints. They cover six seconds, which is enough time to notice a mistake."""
_MAX_MEGABYTES = 1200.0
"""Memory limit of all checkpoints. A larger scan has fewer checkpoints, and a very large scan has none."""

State = TypeVar("State")


class Checkpoints(Generic[State]):
    """Copies of the newest states, the oldest first."""

    def __init__(self) -> None:
        self._checkpoints: deque[tuple[int, State]] = deque()

    def store_if_due(self, state: State, time_ns: int, megabytes: float) -> None:
        """Stores a copy of a state if the newest copy is old enough and memory is left."""
        max_count = min(_MAX_CHECKPOINTS, int(_MAX_MEGABYTES / max(megabytes, 1e-9)))
        newest = self._checkpoints[-1][0] if self._checkpoints else None
        if newest is not None and 0 <= time_ns - newest < _INTERVAL_S * 1e9:
            return
        while len(self._checkpoints) >= max(max_count, 1):
            self._checkpoints.popleft()
        if max_count:
            self._checkpoints.append((time_ns, copy.deepcopy(state)))

    def count_restorable_seconds(self, now_ns: int) -> float:
        """Returns how many seconds :meth:`restore` would undo, or 0 if no checkpoint is old enough."""
        index = self._find_restorable(now_ns)
        return 0.0 if index is None else (now_ns - self._checkpoints[index][0]) * 1e-9

    def restore(self, now_ns: int) -> State | None:
        """Returns the newest checkpoint that is old enough, and drops it and all later ones.

        Returns None if no checkpoint is old enough.
        """
        index = self._find_restorable(now_ns)
        if index is None:
            return None
        state = self._checkpoints[index][1]
        while len(self._checkpoints) > index:
            self._checkpoints.pop()
        return state

    def _find_restorable(self, now_ns: int) -> int | None:
        """Returns the index of the newest checkpoint that is at least half an interval old."""
        restorable = [
            k
            for k, (stored_ns, _) in enumerate(self._checkpoints)
            if now_ns - stored_ns >= 0.5e9 * _INTERVAL_S
        ]
        return restorable[-1] if restorable else None
