"""The health page in headless Chromium, at the size of a desktop and of a phone."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from health_server import BODIES, FINE, HeartbeatEdge, health_page, profile_of
from PIL import Image

from enliven.health_page.page import PageWriter
from enliven.supervision.records import ServiceRecord, runtime_folder, write_service
from enliven.wire import pack_stream

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PATIENCE_S = 300.0
"""Timeout for Chromium, seconds. An idle machine needs three."""
OPTIONS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run")
HOSTILE = "<script>document.title='taken over'</script>"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed"),
]


def chromium(folder: Path, url: str, *options: str) -> str:
    """Returns the standard output of Chromium for a page."""
    command = [str(CHROMIUM), *OPTIONS, f"--user-data-dir={folder}", *options, url]
    return subprocess.run(command, capture_output=True, timeout=PATIENCE_S, text=True, check=True).stdout


def picture_of(folder: Path, url: str, width: int, height: int) -> np.ndarray:
    """Returns a page as (H, W, 3) uint8."""
    path = folder / f"{width}.png"
    size = f"--window-size={width},{height}"
    chromium(folder / "profile", url, size, f"--screenshot={path}")
    return np.asarray(Image.open(path).convert("RGB"))


@pytest.fixture
def page():
    """Runs a page with a healthy edge, a silent edge, an image, and a hostile name."""
    Image.new("RGB", (160, 90), (200, 0, 200)).save(runtime_folder() / "screen.png")
    write_service(ServiceRecord(HOSTILE, os.getpid(), time.time(), time.time()))
    running = {"floor": HeartbeatEdge(BODIES, pack_stream(FINE)), "roof": HeartbeatEdge()}
    try:
        with health_page(profile_of(running)) as page:
            page.wait_for("edge silent")
            yield page
    finally:
        for edge in running.values():
            edge.close()


@pytest.mark.parametrize(("width", "height"), [(1280, 1600), (390, 3000)], ids=["desktop", "phone"])
def test_the_page_fits_its_window(page, tmp_path, width, height):
    picture = picture_of(tmp_path, f"http://127.0.0.1:{page.port}/", width, height)
    assert picture.shape == (height, width, 3)
    reds = (picture[..., 0] > 140) & (picture[..., 1] < 60) & (picture[..., 2] < 60)
    assert reds.sum() > 200, "the border of the problem is missing"
    purple = np.argwhere((picture == (200, 0, 200)).all(axis=2))
    assert len(purple) > 1000, "the picture of the screen is missing"
    # Content that is wider than the window would reach its right border.
    assert purple[:, 1].max() < width - 10
    margin = picture[200:-200, width - 6 :].reshape(-1, 3)
    assert (margin == margin[0]).all(), "something reaches the right border"


def test_the_page_refreshes_itself_and_runs_no_script_of_others(page, tmp_path, monkeypatch):
    writes, write = [], PageWriter.render_health_page

    def count(writer, *values):
        writes.append(writer)
        return write(writer, *values)

    monkeypatch.setattr(PageWriter, "render_health_page", count)
    url = f"http://127.0.0.1:{page.port}/"
    dom = chromium(tmp_path, url, "--virtual-time-budget=12000", "--dump-dom")
    assert len(writes) >= 3, "the page did not refresh itself"
    assert "<title>error: lobby</title>" in dom, "a script of a hostile name ran"
    assert "&lt;script&gt;document.title" in dom and 'id="lost" hidden' in dom


def test_the_page_needs_no_javascript(page):
    """Headless Chromium takes no screenshot without scripts, so the page's text is checked instead."""
    text = re.sub(r"<script.*?</script>", "", page.get("/"), flags=re.DOTALL)
    assert '<noscript><meta http-equiv="refresh"' in text
    assert 'src="/screen.png' in text and "roof" in text and "floor" in text
    assert '<a href="/health">' in text, "links need no script"
