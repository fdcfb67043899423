"""Tests that no clickable widget moves while lists grow: start page, Perform without a stage, and scan."""

from __future__ import annotations

from pathlib import Path

import pytest
from in_a_window import in_a_window

SESSION = Path(__file__).parents[1] / "studio_steady_session.py"
BELOW = ("look for cameras", "voice wanted", "address", "connect", "recorded person", "webcam")
"""Widgets below the list of cameras."""


@pytest.mark.slow
def test_widgets_stay_in_place_as_cameras_are_found_and_previewed(tmp_path: Path) -> None:
    report = in_a_window(SESSION, str(tmp_path))
    for shown, least in (("start page", 20), ("no stage", 30), ("a scan", 5)):
        assert report[shown]["frames"] >= least, shown
        assert report[shown]["moved"] == {}, shown
    assert set(BELOW) <= set(report["no stage"]["widgets"])
    assert "do Armchair" in report["start page"]["widgets"] and "scan start" in report["a scan"]["widgets"]
    assert report["no stage"]["seen"] == ["camera 0", "camera 1", "camera 2", "look 0"], (
        "all lists were shown"
    )
    assert report["looked"] == ["Bright is near, dark is far.", True], "a look has a place of its own"
    assert report["the edge's own list"][1] == "", "the edge's own program filled the list"
