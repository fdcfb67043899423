"""Waits for events of another thread or process, on a machine that may be busy."""

import time
from collections.abc import Callable
from typing import Any

TIMEOUT_S = 60.0
"""Timeout of a wait, seconds. An edge took 28 s to start on a machine with ten times its normal load."""
POLL_INTERVAL_S = 0.005
"""Interval between two checks, seconds."""


def wait_until(
    done: Callable[[], Any],
    what: str = "it",
    patience: float = TIMEOUT_S,
    *,
    step: Callable[[], Any] | None = None,
    interval: float = POLL_INTERVAL_S,
) -> Any:
    """Polls until the condition is true and returns its value. Raises AssertionError with ``what`` after the
    timeout.

    Args:
        done: returns the condition.
        what: the subject of the error message.
        patience: timeout in seconds.
        step: is called after each check, for example to run a program of this process.
        interval: seconds between two checks.
    """
    deadline = time.monotonic() + patience
    while not (answer := done()):
        assert time.monotonic() < deadline, f"{what} never came to be within {patience:g} s"
        if step is not None:
            step()
        time.sleep(interval)
    return answer
