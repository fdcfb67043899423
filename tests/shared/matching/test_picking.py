"""Tests of which match is shown, and when it is accepted."""

from __future__ import annotations

import numpy as np
import pytest

from enliven.matching.abstraction import make_abstract_joint_tree
from enliven.matching.picking import Picker, PickingSettings
from enliven.matching.ranking import Matcher
from enliven.matching.views import ScreenView

POSITIONS = np.array([[0, 0, 0], *((np.cos(a), np.sin(a), 0.0) for a in np.arange(6) * np.pi / 3)])
MATCHER = Matcher(make_abstract_joint_tree(POSITIONS, [(0, i) for i in range(1, 7)]), POSITIONS)


class Performer:
    """One arm that points in given directions, thirty times per second, and a picker that follows it."""

    def __init__(self, **settings):
        self.picker, self.seconds = Picker(PickingSettings(**settings)), 0.0

    def point(self, degrees, frames=1, jitter=0.0, seed=0):
        rng = np.random.default_rng(seed)
        for _ in range(frames):
            angle = np.radians(degrees + jitter * rng.uniform(-1, 1))
            points = np.array([[0, 0, 0], [np.cos(angle), np.sin(angle), 0.0]])
            self.pick = self.picker.update(MATCHER.rank(points, ScreenView()), points, self.seconds)
            self.seconds += 1 / 30
            yield self.arm

    @property
    def arm(self):
        """Returns the displayed arm, by its tip: 1 at 0 degrees, 2 at 60 degrees, ..."""
        return self.pick.match.pairs[0].chain[1]


def test_the_best_is_shown_at_once():
    assert list(Performer().point(58)) == [2]


def test_choice_does_not_flicker_between_equal_matches():
    performer = Performer()
    next(performer.point(20))
    raw = set()
    for arm in performer.point(30, 300, jitter=8.0):
        raw.add(performer.pick.place)
        assert arm == 1
    assert raw == {0, 1}, "the best itself does change"


def test_better_match_takes_over_only_after_a_delay():
    performer = Performer(patience=0.3)
    next(performer.point(0))
    arms = list(performer.point(60, 20))
    assert arms == [1] * 9 + [2] * 11


def test_a_short_twitch_changes_nothing():
    performer = Performer(patience=0.3)
    next(performer.point(0))
    for _ in range(5):
        assert set(performer.point(60, 8)) == {1}
        assert set(performer.point(0, 1)) == {1}


def test_two_rivals_that_take_turns_still_get_through():
    performer = Performer(patience=0.3)
    next(performer.point(180))
    arms = [arm for i in range(12) for arm in performer.point(25 if i % 2 else 35)]
    assert arms[-1] in (1, 2)


def test_cycling_visits_every_match_once_and_comes_round():
    performer = Performer()
    next(performer.point(10))
    seen = []
    for _ in range(6):
        seen.append(performer.picker.cycle().match.pairs[0].chain[1])
        next(performer.point(50))  # the ranking changes meanwhile, but the list does not
    assert seen == [2, 6, 3, 5, 4, 1]
    assert performer.picker.cycle(-1).match.pairs[0].chain[1] == 4


def test_after_a_while_without_a_key_the_pose_decides_again():
    performer = Performer(browsing=1.0, patience=0.3)
    next(performer.point(0))
    performer.picker.cycle()
    performer.picker.cycle()
    arms = list(performer.point(0, 60))
    assert set(arms[:28]) == {6}
    assert arms[-1] == 1


def test_accepted_match_stays_until_reset():
    performer = Performer()
    next(performer.point(0))
    assert performer.picker.accept().pairs[0].chain == (0, 1)
    assert set(performer.point(120, 60)) == {1}
    assert performer.pick.accepted
    assert performer.picker.cycle().match.pairs[0].chain == (0, 1)
    performer.picker.reset()
    assert list(performer.point(120)) == [3]
    assert not performer.pick.accepted


def test_holding_still_accepts_after_the_time_and_not_sooner():
    performer = Performer(by_holding=True, still_seconds=1.0)
    list(performer.point(0, 5))
    list(performer.point(120, 15))  # the match is shown after the patience of 0.3 s
    assert performer.arm == 3
    held = []
    for _ in performer.point(120, 40, jitter=2.0):
        held.append(performer.pick.held)
        if performer.pick.accepted:
            break
    assert performer.pick.accepted
    assert held[:-1] == sorted(held[:-1])
    assert performer.seconds == pytest.approx((5 + 10 + 30) / 30, abs=0.07)


def test_standing_still_accepts_no_match():
    performer = Performer(by_holding=True, still_seconds=1.0)
    list(performer.point(0, 120, jitter=2.0))
    assert not performer.pick.accepted
    assert performer.pick.held == 0.0


def test_after_the_reset_the_same_pose_accepts_nothing_again():
    performer = Performer(by_holding=True, still_seconds=1.0)
    list(performer.point(0, 5))
    list(performer.point(120, 60))
    assert performer.pick.accepted
    performer.picker.reset()
    list(performer.point(120, 120))
    assert not performer.pick.accepted


def test_moving_begins_the_time_again():
    performer = Performer(by_holding=True, still_seconds=1.0)
    list(performer.point(0, 5))
    for degrees in (100, 130, 100, 130):
        list(performer.point(degrees, 25))
        assert not performer.pick.accepted


def test_without_a_match_nothing_is_shown():
    nothing = Matcher(make_abstract_joint_tree(np.zeros((1, 3)), []), np.zeros((1, 3)))
    points = np.eye(3)[:2]
    picker = Picker()
    assert picker.update(nothing.rank(points, ScreenView()), points, 0.0).match is None
    assert picker.accept() is None
    assert picker.cycle().match is None
