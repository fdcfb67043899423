"""A wait between trials that grows while they find nothing."""

from __future__ import annotations

import numpy as np


class Backoff:
    """Says when to run the next of one kind of trial.

    Attributes:
        longest: frames between two trials, at most.
    """

    def __init__(self, longest: int, worse: float = 1.2) -> None:
        """
        Args:
            worse: times the badness of the last failed trial above which to try at once.
        """
        self.longest = longest
        self._worse = worse
        self._wait, self._since, self._in_vain = 1, 0, np.inf

    def is_due(self, badness: float) -> bool:
        """Whether to try in this frame; call it once in every frame that is bad."""
        self._since += 1
        return self._since >= self._wait or badness > self._worse * self._in_vain

    def tried(self, badness: float, *, better: bool) -> None:
        """Takes in the result of a trial in a frame so bad: whether it found something better."""
        self._since = 0
        self._wait = 1 if better else min(2 * self._wait, self.longest)
        self._in_vain = np.inf if better else badness
