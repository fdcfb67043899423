"""Tests of performing in the studio's real window with a real edge, which is killed while recording."""

from __future__ import annotations

import json
from pathlib import Path

from in_a_window import in_a_window

SESSION = Path(__file__).parents[1] / "perform_session.py"


def test_a_performance_is_recorded_onto_the_timeline_and_survives_its_edge(tmp_path: Path) -> None:
    said = in_a_window(SESSION, str(tmp_path), seconds=620.0)
    assert said["done"], json.dumps(said)
    assert said["words"] == ["Performer 1 is in the chair: the whole body"]
    assert said["growing"][0] == 0.0 and said["growing"][1] > 0.8
    assert said["recorded"] == [["arm", "chair"], ["take 1"], True], "it plays at once"
    assert said["solvable"], "the recorded chair can be solved again from its performer"
    assert said["undone"] == [["arm"], "record take 1"], "a recording is one edit"
    kept, told = said["kept"]
    assert kept == 1 and any("edge is gone" in text for text in told)
    assert said["undone both"] == ["record take 1", "record take 2"]
    assert said["takes"][:3] == ["take 1", "take 2", "take 3"]
    first, second = said["layered"]
    assert 0 < first < second, "the second layer lies over the first, and over a cut"
    for hidden, live in said["shown once"]:
        assert hidden == ["arm", "chair"] and live == ["chair", "arm"], "each is shown once"
    assert said["close"] == [True, True, False], "the view goes to what is about to be held, and back"
    assert said["each"] == {}, "every action on a stage was done"
