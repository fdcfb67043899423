"""Tests of puppets in the studio's real window, if there is a display or Xvfb."""

from __future__ import annotations

from pathlib import Path

import pytest
from in_a_window import in_a_window

SESSION = Path(__file__).parents[1] / "studio_puppets_session.py"
GIZMO_SESSION = Path(__file__).parents[1] / "studio_gizmo_session.py"


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


@pytest.mark.slow
def test_mouse_and_finger_drag_each_part_of_the_gizmo_in_the_window(tmp_path) -> None:
    report = in_a_window(GIZMO_SESSION, str(tmp_path))
    assert report["done"] and report["bad"] == [], report
    for hand in ("mouse", "finger"):
        for part, (moved, is_edit, is_undone) in report[hand].items():
            assert is_edit and is_undone, f"{hand}, {part}: a drag is one step of undo"
            expected = [part == "view" or axis in part for axis in "xyz"]
            assert [abs(offset) > 1e-4 for offset in moved] == expected, (hand, part, moved)
    unmoved = [[0.0, 0.0, 0.0], False, True]
    assert report["mouse beside y"] == unmoved
    (across, up, towards), *_ = report["finger beside y"]
    assert up > 0.05 and across == towards == 0.0, "a finger grabs the arrow from farther away"
    assert report["escape"] == unmoved
