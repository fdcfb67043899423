"""Tests that the button on the health page makes a real edge learn the room again."""

from __future__ import annotations

import contextlib
import re
import threading
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlencode

import pytest
from health_server import Page, health_page
from patience import TIMEOUT_S

from enliven.kiosk.profile import KioskEdge, KioskProfile
from enliven.wire import LearnRoom, Order
from enliven_edge.network.handlers import Handler

from .exposed_edge import ExposedEdge


@pytest.fixture(autouse=True)
def own_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Gives each test its own records, data and keys, and removes the minimum time between two actions."""
    monkeypatch.setattr("enliven.health_page.collector.REFRESH_INTERVAL_S", 0.1)
    monkeypatch.setattr("enliven.health_page.app._MIN_ACTION_INTERVAL_S", 0.0)
    monkeypatch.setenv("ENLIVEN_RUNTIME", str(tmp_path / "runtime"))
    for name in ("XDG_STATE_HOME", "XDG_CONFIG_HOME"):
        monkeypatch.setenv(name, str(tmp_path / name))


@contextlib.contextmanager
def running(exposed: ExposedEdge) -> Iterator[None]:
    """Runs an edge in the background."""
    is_over = threading.Event()

    def run() -> None:
        while not is_over.wait(0.005):
            exposed.frame()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join(TIMEOUT_S)
        exposed.close()


def press(page: Page) -> tuple[int, str]:
    """Confirms the action for the edge, and returns the status and the text of the answer."""
    status, _, body = page.request("GET", "/confirm?action=room&subject=floor")
    assert status == 200 and "Learn the room again?" in body.decode()
    fields = dict(re.findall(r'name="(subject|token)" value="([^"]*)"', body.decode()))
    status, _, body = page.request("POST", "/room", body=urlencode(fields))
    return status, body.decode()


def test_button_makes_the_edge_learn_the_room() -> None:
    exposed = ExposedEdge()
    done: list[Order] = []
    address = str(exposed.outlet.publisher.endpoint)
    with running(exposed), health_page(KioskProfile(edges={"floor": KioskEdge(address=address)})) as page:
        page.wait_for("action=room")
        # The sensor tracks people itself, so the real edge refuses to learn the room.
        status, text = press(page)
        assert status == 409 and "learns no room" in text
        exposed.edge.handlers[LearnRoom] = Handler(done.append)
        assert press(page)[0] == 303
        assert done == [LearnRoom()] and "made floor learn the room again" in page.get("/")
        assert page.request("POST", "/room", body="subject=floor&token=wrong")[0] == 409
        assert page.request("GET", "/confirm?action=room&subject=roof")[0] == 404
    assert done == [LearnRoom()]
