"""Tests of performing in the studio's real window with a real edge, which is killed during a recording."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from in_a_window import in_a_window

SESSION = Path(__file__).parents[1] / "perform_session.py"


@pytest.mark.slow
def test_a_performance_is_recorded_onto_the_timeline_and_survives_its_edge(tmp_path: Path) -> None:
    report = in_a_window(SESSION, str(tmp_path), seconds=620.0)
    assert report["done"], json.dumps(report)
    assert report["words"] == ["Performer 1 is in the chair: the whole body"]
    assert report["growing"][0] == 0.0 and report["growing"][1] > 0.8
    assert report["recorded"] == [["arm", "chair"], ["take 1"], True], "it plays at once"
    assert report["solvable"], "the recorded chair can be solved again from its performer"
    assert report["undone"] == [["arm"], "record take 1"], "a recording is one edit"
    kept_count, messages = report["kept"]
    assert kept_count == 1 and any("stage was lost" in text for text in messages)
    assert report["undone both"] == ["record take 1", "record take 2"]
    assert report["takes"][:3] == ["take 1", "take 2", "take 3"]
    first, second = report["layered"]
    assert 0 < first < second, "the second layer lies over the first, and over a cut"
    for hidden, live in report["shown once"]:
        assert hidden == ["arm", "chair"] and live == ["chair", "arm"], "each is shown once"
    assert report["close"] == [True, True, False], "the view goes to what is about to be held, and back"
    assert report["each"] == {}, "every action on a stage was done"
