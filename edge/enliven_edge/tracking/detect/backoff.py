"""Exponential backoff: a wait between trials that grows while they fail."""

from __future__ import annotations

import numpy as np


class Backoff:
    """Decides when to run the next trial of one kind.

    Call :meth:`is_due` once per frame, :meth:`start` when a trial begins, and :meth:`record` when it ends,
    in the same or in a later frame.

    Attributes:
        max_interval: maximum number of frames between the starts of two trials.
    """

    def __init__(self, max_interval: int, *, first_interval: int = 1, worse: float = 1.2) -> None:
        """Sets the limits.

        Args:
            max_interval: maximum number of frames between the starts of two trials.
            first_interval: number of frames between them before a trial has failed.
            worse: if the badness exceeds that of the last failed trial by this factor, the wait is
                ``first_interval`` again.
        """
        self.max_interval, self._first_interval = max_interval, first_interval
        self._worse = worse
        self._wait, self._since, self._failed_badness = first_interval, 0, np.inf

    def is_due(self, badness: float) -> bool:
        """Returns True if a trial may start in this frame.

        ``badness`` measures how bad the frame is, in any unit.
        """
        self._since += 1
        is_worse = badness > self._worse * self._failed_badness
        return self._since >= (self._first_interval if is_worse else self._wait)

    def start(self) -> None:
        """Records that a trial begins."""
        self._since = 0

    def record(self, badness: float, *, better: bool) -> None:
        """Records the result of a trial in a frame with this badness."""
        self._wait = self._first_interval if better else min(2 * self._wait, self.max_interval)
        self._failed_badness = np.inf if better else badness

    def reset(self) -> None:
        """Forgets the failed trials, after a good frame."""
        self._wait, self._failed_badness = self._first_interval, np.inf
