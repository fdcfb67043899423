"""Work that is spread over several frames, so much in each.

It is counted in coarse fits, never by a clock: the same frames give the same people on every machine.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, Generic, TypeVar

T = TypeVar("T")
Steps = Generator[int, Any, T]
"""Work in parts: yields what each part has cost, in coarse fits, and returns what was made."""

LOOK = 2
"""What a look of the network at a group of pixels costs, in coarse fits."""
_RATE = 30.0
"""Frames a second for which the budget of a frame is meant."""


class Budget:
    """What a frame may still cost.

    Attributes:
        left: coarse fits; infinite where nothing is spread.
    """

    def __init__(self, fits: float) -> None:
        self.left = fits


def frame_budget(fits: int, elapsed: float | None) -> Budget:
    """The budget of a frame, more where frames are rare: a search takes as long at every frame rate.

    Args:
        fits: coarse fits a frame at 30 frames a second; 0: no limit.
        elapsed: seconds since the frame before; None: it is the first.
    """
    if fits == 0:
        return Budget(float("inf"))
    return Budget(fits * max(1.0, (elapsed or 0.0) * _RATE))


class BudgetedTask(Generic[T]):
    """Work that is under way.

    Attributes:
        done: whether it is finished.
    """

    def __init__(self, steps: Steps[T]) -> None:
        self._steps = steps
        self._result: T | None = None
        self.done = False

    @property
    def result(self) -> T:
        """What was made, once it is done."""
        assert self.done
        return self._result  # type: ignore[return-value]

    def go_on(self, budget: Budget) -> bool:
        """Works on until the budget is spent, or over by less than one part; whether it is done."""
        while not self.done and budget.left > 0.0:
            try:
                budget.left -= next(self._steps)
            except StopIteration as stop:
                self._result, self.done = stop.value, True
        return self.done


def whole(steps: Steps[T]) -> T:
    """All of the work at once."""
    spread = BudgetedTask(steps)
    spread.go_on(Budget(float("inf")))
    return spread.result
