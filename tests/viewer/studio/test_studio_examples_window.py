"""Tests of the example panel in the studio's real window, if there is a display or Xvfb."""

from __future__ import annotations

from pathlib import Path

from in_a_window import in_a_window

SESSION = Path(__file__).parents[1] / "studio_examples_session.py"


def test_a_star_acts_after_two_poses_in_the_window(tmp_path) -> None:
    said = in_a_window(SESSION, str(tmp_path))
    assert said["done"] and said["spread"] > 30 and said["bad"] == [], said
    assert said["chosen"] and said["plays"] == ["sway"] and said["paired"] == "bone 3" and said["foot"], said
    assert said["joints"] and said["editing"] == 1 and said["poses"] == 2 and said["problem"] == "None", said
    assert said["retimed"] and said["duplicated"] == 3 and said["removed"] == 2, said
    assert said["time"] > 0.2 and said["held"] == 1 and said["left"] and said["again"], said
