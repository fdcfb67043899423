"""pytest plug-in: a run in which a test process ended has an exit status of its own.

The tests that were left for that process did not run, so the run must not count as complete, even if
the test that ended it passes when it is repeated. Load it with ``-p ended_processes``.
"""

from typing import Any

import pytest

STATUS = 7
"""Exit status of such a run. pytest itself uses 0 to 5."""

_ended: list[str] = []


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object | None) -> None:
    """Notes a test process that ended before it was told to."""
    if error:
        _ended.append(node.gateway.id)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Replaces the exit status if a test process ended."""
    if _ended:
        session.exitstatus = STATUS
        print(f"\nTest processes that ended, so that other tests did not run: {', '.join(_ended)}")
