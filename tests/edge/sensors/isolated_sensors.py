"""A faulty sensor in a helper process, and a fixture that checks that no helper is left."""

import time
from pathlib import Path

import pytest
from contract import TIMEOUT_S, helpers
from wild import Wild

from enliven_edge.sensors.isolation.isolated import IsolatedOpener


def opener(folder: Path, every_frame: bool = False, **options) -> IsolatedOpener:
    return IsolatedOpener("wild", Wild, {"folder": str(folder), **options}, every_frame)


@pytest.fixture(autouse=True)
def none_left():
    """Checks that every test ends without a helper process."""
    yield
    deadline = time.monotonic() + TIMEOUT_S
    while helpers():
        assert time.monotonic() < deadline, "a helper process was left"
        time.sleep(0.01)
