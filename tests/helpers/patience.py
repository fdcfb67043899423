"""Waiting for what another thread or process does, on a machine that may be busy with much else."""

import time
from collections.abc import Callable
from typing import Any

PATIENCE = 60.0
"""Seconds until a wait is given up: an edge took 28 s to start on a machine with ten times its work."""
PAUSE = 0.005
"""Seconds between two looks."""


def until(done: Callable[[], Any], what: str = "it", patience: float = PATIENCE) -> Any:
    """Look again and again; the first true answer, or an AssertionError that says what never came to be."""
    deadline = time.monotonic() + patience
    while not (answer := done()):
        assert time.monotonic() < deadline, f"{what} never came to be within {patience:g} s"
        time.sleep(PAUSE)
    return answer
