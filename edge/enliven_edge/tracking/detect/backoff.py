"""Exponential backoff: a wait between trials that grows while they fail."""

from __future__ import annotations

import numpy as np


class Backoff:
    """Decides when to run the next trial of one kind.

    Attributes:
        max_interval: maximum number of frames between two trials.
    """

    def __init__(self, max_interval: int, worse: float = 1.2) -> None:
        """Sets the limits.

        Args:
            max_interval: maximum number of frames between two trials.
            worse: if the badness exceeds that of the last failed trial by this factor, the next trial is due
                at once.
        """
        self.max_interval = max_interval
        self._worse = worse
        self._wait, self._since, self._failed_badness = 1, 0, np.inf

    def is_due(self, badness: float) -> bool:
        """Returns True if a trial should run in this frame. Call it once in every bad frame.

        ``badness`` measures how bad the frame is, in any unit.
        """
        self._since += 1
        return self._since >= self._wait or badness > self._worse * self._failed_badness

    def record(self, badness: float, *, better: bool) -> None:
        """Records a trial in a frame with this badness. ``better`` is True if it found a better result."""
        self._since = 0
        self._wait = 1 if better else min(2 * self._wait, self.max_interval)
        self._failed_badness = np.inf if better else badness
