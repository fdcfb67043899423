"""Tests of puppets in the studio's real window, if there is a display or Xvfb."""

from __future__ import annotations

from pathlib import Path

import pytest
from in_a_window import in_a_window

SESSION = Path(__file__).parents[1] / "studio_puppets_session.py"


@pytest.mark.slow
def test_an_artist_poses_a_puppet_in_the_window(tmp_path) -> None:
    report = in_a_window(SESSION, str(tmp_path))
    assert report["done"] and report["bad"] == [], report
    assert report["points"] == 4 and report["pose"][0] == 0, report
    across, up, towards = report["pose"][1]
    assert up > 0.03 and across == towards == 0.0, "the green arrow moves along y alone"
    assert "point 1 passes through" in report["warning"] and report["red"] > 600, report
    assert report["changed"] > 500 and not report["left"] and report["playing"], report
    first, *others = report["steady"]
    assert len(others) == 6 and all(first) and all(other == first for other in others), report["steady"]
    left, top, wide, high = report["column"]
    box = first[1]
    assert left <= box[0] and box[2] <= left + wide and top <= box[1] and box[3] <= top + high
