"""pytest plug-in that records the unfinished tests if a test process ends, so that they can run again.

A process ends if a library crashes it, or if a test exceeds the time limit. Load this plug-in with
``-p unfinished_tests``.
"""

from __future__ import annotations

from typing import Any

import pytest

CACHE_KEY = "enliven/unfinished"
"""Entry of pytest's cache with the tests, as pytest names them. The list is empty if no process ended."""

_ended: list[str] = []
_collected: set[str] = set()
_finished: set[str] = set()


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object | None) -> None:
    """Records a test process that ended unexpectedly."""
    if error:
        _ended.append(node.gateway.id)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_node_collection_finished(node: Any, ids: list[str]) -> None:
    """Records all tests of the run."""
    _collected.update(ids)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Records a test that ran to its end."""
    if report.when == "teardown":
        _finished.add(report.nodeid)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Stores the tests that did not finish."""
    cache = getattr(session.config, "cache", None)
    if cache is None or hasattr(session.config, "workerinput"):
        return
    cache.set(CACHE_KEY, sorted(_collected - _finished) if _ended else [])
