"""Tests of choosing the common time at which several edges are shown."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from enliven_viewer.live.common_moment import MAX_LAG_NS, CommonMoment

MS = 1_000_000
NOW = 10_000_000 * MS


def test_the_fast_edge_waits_for_the_slow_one() -> None:
    assert CommonMoment().find_lags({"fast": NOW - 20 * MS, "slow": NOW - 90 * MS}, NOW) == {
        "fast": 70 * MS,
        "slow": 0,
    }


def test_one_edge_is_not_delayed() -> None:
    assert CommonMoment().find_lags({"only": NOW}, NOW) == {"only": 0}


def test_nobody_waits_for_a_silent_edge_or_one_whose_clock_was_set() -> None:
    for odd in (NOW - 5000 * MS, NOW + 3_600_000 * MS):
        assert CommonMoment().find_lags({"good": NOW, "odd": odd}, NOW) == {"good": 0, "odd": 0}


def test_the_delay_is_limited() -> None:
    lags = CommonMoment().find_lags({"fast": NOW, "slow": NOW - 900 * MS}, NOW)
    assert lags == {"fast": MAX_LAG_NS, "slow": 0}


@given(st.lists(st.tuples(st.integers(0, 200), st.integers(0, 200)), min_size=2, max_size=40))
def test_the_shown_moment_never_goes_back_and_is_the_same_for_both(delays: list[tuple[int, int]]) -> None:
    moment, shown = CommonMoment(), []
    newest = {"a": 0, "b": 0}
    for step, (a, b) in enumerate(delays):
        now = NOW + step * 16 * MS
        newest = {"a": max(newest["a"], now - a * MS), "b": max(newest["b"], now - b * MS)}
        lags = moment.find_lags(newest, now)
        times = {key: newest[key] - lags[key] for key in newest}
        shown.append(max(times.values()))
        # An edge that has not delivered this moment yet shows its newest frame.
        assert all(time == shown[-1] or lags[key] == 0 for key, time in times.items())
    assert shown == sorted(shown)
