"""A work budget for each frame, and tasks that are spread over several frames.

Work is counted in coarse fits, never by a clock, so that the same frames give the same people on every
machine.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, Generic, TypeVar

T = TypeVar("T")
"""The type of a task's result."""
Steps = Generator[float, Any, T]
"""A task as a generator: it yields the cost of each step, in coarse fits, and returns its result."""
NETWORK_COST = 2
"""Cost of evaluating the network on one blob of pixels, in coarse fits."""
_REFERENCE_FPS = 30.0
"""Frames per second at which a frame's budget equals the setting."""


class Budget:
    """The work budget that remains for a frame.

    Attributes:
        left: remaining coarse fits; infinite without a limit.
    """

    def __init__(self, fits: float) -> None:
        self.left = fits


def frame_budget(fits: int, elapsed: float | None) -> Budget:
    """Returns the budget of a frame.

    It is larger at a low frame rate, so that a search takes equally long at every frame rate.

    Args:
        fits: coarse fits per frame at 30 frames per second; 0: no limit.
        elapsed: seconds since the previous frame; None: this is the first.
    """
    if fits == 0:
        return Budget(float("inf"))
    return Budget(fits * max(1.0, (elapsed or 0.0) * _REFERENCE_FPS))


class BudgetedTask(Generic[T]):
    """A task that runs step by step within the budget of each frame.

    Attributes:
        done: whether it is finished.
    """

    def __init__(self, steps: Steps[T]) -> None:
        self._steps = steps
        self._result: T | None = None
        self.done = False

    @property
    def result(self) -> T:
        """Returns the task's result. May be read only after the task is done."""
        assert self.done
        return self._result  # type: ignore[return-value]

    def go_on(self, budget: Budget) -> bool:
        """Works until the budget is spent, and returns whether the task is done.

        The last step may overdraw the budget.
        """
        while not self.done and budget.left > 0.0:
            try:
                budget.left -= next(self._steps)
            except StopIteration as stop:
                self._result, self.done = stop.value, True
        return self.done


def run_to_end(steps: Steps[T]) -> T:
    """Runs a task to its end without a limit and returns its result."""
    task = BudgetedTask(steps)
    task.go_on(Budget(float("inf")))
    return task.result
