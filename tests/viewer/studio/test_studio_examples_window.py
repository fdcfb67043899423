"""Tests of the example panel in the studio's real window, if there is a display or Xvfb."""

from __future__ import annotations

from pathlib import Path

import pytest
from in_a_window import in_a_window

SESSION = Path(__file__).parents[1] / "studio_examples_session.py"


@pytest.mark.slow
def test_a_star_acts_after_two_poses_in_the_window(tmp_path) -> None:
    report = in_a_window(SESSION, str(tmp_path))
    assert report["done"] and report["spread"] > 30 and report["bad"] == [], report
    assert (
        report["chosen"] and report["plays"] == ["sway"] and report["paired"] == "bone 3" and report["foot"]
    ), report
    assert (
        report["joints"] and report["editing"] == 1 and report["poses"] == 2 and report["problem"] == "None"
    ), report
    assert report["retimed"] and report["duplicated"] == 3 and report["removed"] == 2, report
    assert report["time"] > 0.2 and report["held"] == 1 and report["left"] and report["again"], report
