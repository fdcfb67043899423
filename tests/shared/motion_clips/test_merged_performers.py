"""Tests that tracking losses create no extra takes: one take for each performer, and separate ones for
onlookers.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from swaying import swaying

from enliven.document.project import Project
from enliven.frames import BodyFrame
from enliven.motion_clips.merged_performers import merge_performers
from enliven.overdub.performance import PerformedMotion
from enliven.overdub.performance_takes import add_performance
from enliven.wire import HoldMessage

STEP = 33_333_333


def body(who: int, number: int, x: float = 0.0):
    swayed = swaying(1, number)
    return replace(swayed, id=who, joints=swayed.joints + np.array([x, 0.0, 0.0]))


def frames(count: int, who) -> list[BodyFrame]:
    """Returns frames whose visible people and positions are determined by the function ``who``."""
    return [BodyFrame([body(i, n, x) for i, x in who(n)], n * STEP, "edge") for n in range(count)]


def held(who: int, seconds: float = 0.0, mode: str = "alone", former: int = -1) -> HoldMessage:
    time_ns = round(seconds * 1e9)
    return HoldMessage("chair", time_ns, mode, body=who, former=former, holders=[who])


def recorded(seen: list[BodyFrame], *events: HoldMessage) -> dict[str, float]:
    performed = PerformedMotion("take 1", 0, frames=seen, events=list(events))
    project, names = add_performance(Project(), performed, 0)
    assert set(names) == set(project.takes)
    return {name: take.duration for name, take in project.takes.items()}


def test_24_losses_make_one_take() -> None:
    """Each time, the tracker finds the performer with a new id after 0.1 to 1 s."""

    def who(n: int):
        track, since = divmod(n, 40)
        return [] if since < 1 + track else [(1 + track, 0.02 * track)]

    takes = recorded(frames(24 * 40, who))
    assert list(takes) == ["take 1"] and takes["take 1"] == pytest.approx(24 * 40 / 30, abs=0.2)


def test_same_id_is_one_take_after_any_gap() -> None:
    takes = recorded(frames(600, lambda n: [] if 100 < n < 400 else [(1, 0.0)]))
    assert list(takes) == ["take 1"] and takes["take 1"] == pytest.approx(599 / 30, abs=0.1)


def test_lost_performer_stays_still() -> None:
    seen = frames(200, lambda n: [(1, 0.0)] if n < 60 else [(1, 1.2)] if n > 140 else [])
    merged = merge_performers(seen)
    hips = {f.time_ns // STEP: b.joints[0, 0] for f in merged.frames for b in f.bodies}
    last = max(n for n in hips if n < 141)
    assert last > 125 and hips[last] == pytest.approx(hips[59]), "still until shortly before"


def test_crossing_performers_keep_their_takes() -> None:
    def who(n: int):
        if 80 <= n < 90:
            return []
        first, second = (1, 2) if n < 80 else (8, 9)
        return [(first, -1.5), (second, 1.5)]

    takes = recorded(frames(160, who))
    assert list(takes) == ["take 1 1", "take 1 2"]
    assert all(seconds > 5.0 for seconds in takes.values())
    merged = merge_performers(frames(160, who))
    assert merged.people == {1: 1, 2: 2, 8: 1, 9: 2}, "by where they were lost"


def test_different_person_gets_a_separate_take() -> None:
    later = frames(400, lambda n: [(1, 0.0)] if n < 100 else [(2, 0.2)] if n > 260 else [])
    assert merge_performers(later).people == {1: 1, 2: 2}
    elsewhere = frames(200, lambda n: [(1, 0.0)] if n < 100 else [(2, 4.0)] if n > 105 else [])
    assert merge_performers(elsewhere).people == {1: 1, 2: 2}
    beside = frames(200, lambda n: [(1, 0.0)] if n < 100 else [(1, 0.0), (2, 0.5)])
    assert merge_performers(beside).people == {1: 1, 2: 2}, "both are there at once"


def test_handed_over_hold_identifies_the_performer() -> None:
    """This holds even after a long time and far away, since the edge reports that it is the same
    performer.
    """
    seen = frames(400, lambda n: [(1, 0.0)] if n < 100 else [(5, 3.0)] if n > 300 else [])
    takes = recorded(seen, held(1), held(5, 10.1, "take over", 1))
    assert list(takes) == ["take 1"]


def test_unattached_person_is_an_onlooker() -> None:
    seen = frames(200, lambda n: [(1, 0.0), (2, 3.0), *([(3, -3.0)] if n > 100 else [])])
    assert list(recorded(seen, held(2))) == ["take 1", "take 1 onlooker 1", "take 1 onlooker 2"]
    assert list(recorded(seen)) == ["take 1 1", "take 1 2", "take 1 3"], (
        "with no character all are performers"
    )


def test_nobody_and_unknown_joints_make_nothing_and_no_fault() -> None:
    lost = replace(body(1, 0), joints=np.full((20, 3), np.nan))
    assert merge_performers([BodyFrame([lost], n * STEP, "edge") for n in range(3)]).people == {1: 1}
    assert merge_performers([]).frames == []
