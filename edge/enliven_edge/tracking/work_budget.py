"""A budget of work for each frame, and tasks that are spread over several frames.

Work is counted in coarse fits, never by a clock: the same frames give the same people on every machine.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, Generic, TypeVar

T = TypeVar("T")
"""The type of a task's result."""
Steps = Generator[float, Any, T]
"""A task in parts: it yields the cost of each part, in coarse fits, and returns its result."""
LOOK = 2
"""Coarse fits that the network costs for one group of pixels."""
_RATE = 30.0
"""Frames a second at which the budget of a frame is the setting."""


class Budget:
    """The work that is left for a frame.

    Attributes:
        left: coarse fits; infinite without a limit.
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
    """A task that runs in parts, as far as the budget of each frame goes.

    Attributes:
        done: whether it is finished.
    """

    def __init__(self, steps: Steps[T]) -> None:
        self._steps = steps
        self._result: T | None = None
        self.done = False

    @property
    def result(self) -> T:
        """The task's result, once it is done."""
        assert self.done
        return self._result  # type: ignore[return-value]

    def go_on(self, budget: Budget) -> bool:
        """Works until the budget is spent, overdrawn by less than one part; returns whether it is done."""
        while not self.done and budget.left > 0.0:
            try:
                budget.left -= next(self._steps)
            except StopIteration as stop:
                self._result, self.done = stop.value, True
        return self.done


def whole(steps: Steps[T]) -> T:
    """Runs a task to its end at once; returns its result."""
    task = BudgetedTask(steps)
    task.go_on(Budget(float("inf")))
    return task.result
