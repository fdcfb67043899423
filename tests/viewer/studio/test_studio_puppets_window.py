"""Tests of puppets in the studio's real window, if there is a display or Xvfb."""

from __future__ import annotations

from pathlib import Path

from in_a_window import in_a_window

SESSION = Path(__file__).parents[1] / "studio_puppets_session.py"


def test_an_artist_poses_a_puppet_in_the_window(tmp_path) -> None:
    said = in_a_window(SESSION, str(tmp_path))
    assert said["done"] and said["bad"] == [], said
    assert said["points"] == 4 and said["pose"][0] == 0, said
    across, up, towards = said["pose"][1]
    assert up > 0.03 and across == towards == 0.0, "the green arrow moves along y alone"
    assert "point 1 goes through" in said["warning"] and said["red"] > 600, said
    assert said["changed"] > 500 and not said["left"] and said["playing"], said
    first, *others = said["steady"]
    assert len(others) == 6 and all(first) and all(other == first for other in others), said["steady"]
    left, top, wide, high = said["column"]
    box = first[1]
    assert left <= box[0] and box[2] <= left + wide and top <= box[1] and box[3] <= top + high
