"""When to try again what was tried in vain: rarer and rarer, but at once where things get worse."""

from __future__ import annotations

import numpy as np


class Patience:
    """Of one kind of trial.

    Attributes:
        longest: frames between two trials, at most.
    """

    def __init__(self, longest: int, worse: float = 1.2) -> None:
        """
        Args:
            worse: how many times as bad as at the last trial it must be to try at once.
        """
        self.longest = longest
        self._worse = worse
        self._wait, self._since, self._in_vain = 1, 0, np.inf

    def is_due(self, badness: float) -> bool:
        """Whether to try in this frame; asked once in every frame that is bad."""
        self._since += 1
        return self._since >= self._wait or badness > self._worse * self._in_vain

    def tried(self, badness: float, *, better: bool) -> None:
        """A trial was made, of a frame so bad, and found something better or did not."""
        self._since = 0
        self._wait = 1 if better else min(2 * self._wait, self.longest)
        self._in_vain = np.inf if better else badness
