"""Tests of the image for an audience while the edge is lost, and of the performers' numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enliven.person.body import Body
from enliven_viewer.live.idle_loop import LOSS_TEXTS, IdleLoop, find_loss_reason
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.live.performer_numbers import PerformerNumbers
from enliven_viewer.playback.document import Document, EdgeState
from enliven_viewer.playback.timeline import NS_PER_S
from enliven_viewer.render.camera import OrbitCamera


class Feed:
    """An edge whose state the test sets."""

    def __init__(self) -> None:
        self.edge = EdgeState(connected=True, address="tcp://127.0.0.1:5580", phase="tracking")
        self.performs, self.count = True, 0

    def poll(self, document: Document) -> int:
        document.edge = self.edge
        if not self.performs:
            return 0
        self.count += 1
        joints = [[0.01 * self.count, 0.0, 0.0]] * 20
        document.add_bodies(self.count * NS_PER_S // 10, [Body(1, np.array(joints), np.ones(20))])
        return 1

    def ask(self, *_: object) -> None: ...

    def close(self) -> None: ...


@pytest.fixture
def shown() -> tuple[Feed, LiveStage, IdleLoop, OrbitCamera]:
    """Returns a stage after a minute's performance."""
    feed = Feed()
    live, loop, camera = LiveStage(feed, Document()), IdleLoop(), OrbitCamera()
    for _ in range(600):
        advance(live, loop, camera, 0.1)
    return feed, live, loop, camera


def advance(
    live: LiveStage, loop: IdleLoop, camera: OrbitCamera, seconds: float, orbits: bool = True
) -> None:
    live.advance(seconds)
    loop.advance(live, camera, seconds, orbits=orbits)


LOSSES = [
    ({"connected": False}, "away"),
    ({"signal": "silent"}, "silent"),
    ({"phase": "ended"}, "ended"),
]


@pytest.mark.parametrize(("change", "loss"), LOSSES)
def test_last_performance_is_replayed_until_the_edge_returns(shown, change, loss) -> None:
    feed, live, loop, camera = shown
    feed.edge, feed.performs = replace(feed.edge, **change), False
    advance(live, loop, camera, 1.0)
    assert loop.audience_text == "" and live.playhead.live, "a second is no loss"
    advance(live, loop, camera, 1.0)
    assert loop.audience_text == LOSS_TEXTS[loss] and not live.playhead.live
    places = set()
    for _ in range(1000):
        advance(live, loop, camera, 0.1)
        places.add(live.playhead.time_ns)
    end = live.document.timeline.end_ns
    assert min(places) >= end - 30 * NS_PER_S - NS_PER_S // 5 and len(places) > 100, (
        "the last half minute, over and over"
    )
    feed.edge, feed.performs = EdgeState(connected=True, phase="tracking"), True
    advance(live, loop, camera, 0.1)
    assert loop.audience_text == "" and live.playhead.live
    advance(live, loop, camera, 0.1)
    assert live.playhead.time_ns == live.document.timeline.end_ns


def test_missing_edge_is_reported_and_the_view_turns() -> None:
    feed = Feed()
    feed.edge, feed.performs = EdgeState(connected=False), False
    live, loop, camera = LiveStage(feed, Document()), IdleLoop(), OrbitCamera()
    before = camera.goal
    for _ in range(30):
        advance(live, loop, camera, 0.1)
    assert loop.loss == "waiting" and live.playhead.live and camera.goal != before
    calm = camera.goal
    advance(live, loop, camera, 0.1, orbits=False)
    assert camera.goal == calm, "not for those who want less motion"


def test_words_for_an_audience_name_no_address_and_no_key() -> None:
    for words in LOSS_TEXTS.values():
        assert not any(mark in words for mark in ("127", "tcp", "ms", "(", "Ctrl", "press"))


def test_a_take_and_no_stage_at_all_are_not_lost() -> None:
    feed = Feed()
    feed.edge, feed.performs = EdgeState(connected=False), False
    assert find_loss_reason(LiveStage(feed, Document(), take="take.mcap")) == ""
    loop = IdleLoop()
    loop.advance(None, OrbitCamera(), math.inf, orbits=True)
    assert loop.audience_text == ""


@given(st.lists(st.sets(st.integers(1, 60), max_size=6), max_size=12))
def test_performers_have_the_lowest_numbers_and_keep_them_while_they_are_there(steps) -> None:
    numbers, before = PerformerNumbers(), {}
    for present in steps:
        numbers.update_performers(present)
        now = {body: numbers.number_of(body) for body in present}
        assert len(set(now.values())) == len(now) and all(1 <= n <= 6 for n in now.values())
        assert all(now[body] == n for body, n in before.items() if body in now)
        before = now


def test_person_who_returns_is_performer_1_again() -> None:
    numbers = PerformerNumbers()
    for body in (1, 17, 23):
        numbers.update_performers([body])
        assert numbers.number_of(body) == 1
        numbers.update_performers([])
