"""A work budget for each frame, and tasks that are spread over several frames.

The unit of work is a coarse fit. No clock is used, so the same frames give the same people on every machine.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, Generic, TypeVar, cast

T = TypeVar("T")
"""Type variable for the result of a task."""
Steps = Generator[float, Any, T]
"""A task as a generator: it yields the cost of each step, in coarse fits, and returns its result."""
NETWORK_COST = 2
"""Cost of evaluating the network on one blob of pixels, in coarse fits."""
_REFERENCE_FPS = 30.0
"""Frames per second at which a frame's budget equals the setting."""


class Budget:
    """The work budget that remains for a frame.

    Attributes:
        remaining: remaining coarse fits; infinite without a limit.
    """

    def __init__(self, fits: float) -> None:
        self.remaining = fits


def frame_budget(fits: int, elapsed: float | None) -> Budget:
    """Returns the budget of a frame.

    At a low frame rate each frame has a larger budget, so that a search takes the same time at every frame
    rate.

    Args:
        fits: budget in coarse fits per frame at 30 frames per second. 0 means no limit.
        elapsed: seconds since the previous frame; None in the first frame.
    """
    if fits == 0:
        return Budget(float("inf"))
    return Budget(fits * max(1.0, (elapsed or 0.0) * _REFERENCE_FPS))


class BudgetedTask(Generic[T]):
    """A task that runs step by step within the budget of each frame.

    Attributes:
        is_done: whether the task is finished.
    """

    def __init__(self, steps: Steps[T]) -> None:
        self._steps = steps
        self._result: T | None = None
        self.is_done = False

    @property
    def result(self) -> T:
        """Returns the task's result. Call it only after the task is done."""
        assert self.is_done
        return cast(T, self._result)

    def advance(self, budget: Budget) -> bool:
        """Works until the budget is spent. Returns True if the task is done.

        The last step may overdraw the budget.
        """
        while not self.is_done and budget.remaining > 0.0:
            try:
                budget.remaining -= next(self._steps)
            except StopIteration as stop:
                self._result, self.is_done = stop.value, True
        return self.is_done


def run_to_end(steps: Steps[T]) -> T:
    """Runs a task to its end without a limit and returns its result."""
    task = BudgetedTask(steps)
    task.advance(Budget(float("inf")))
    return task.result
