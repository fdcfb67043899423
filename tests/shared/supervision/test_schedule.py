"""Tests of the time of the nightly restart, with clock changes and daylight saving time."""

from __future__ import annotations

import datetime
import time
from collections.abc import Iterator
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.errors import InputError
from enliven.supervision.schedule import NightlyRestart, parse_time_of_day

BERLIN = ZoneInfo("Europe/Berlin")
HOUR_S = 3600.0


@pytest.fixture(autouse=True)
def berlin(monkeypatch) -> Iterator[None]:
    """Sets the local time zone to one with daylight saving time."""
    monkeypatch.setenv("TZ", "CET-1CEST,M3.5.0,M10.5.0/3")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def unix_s(*date: int) -> float:
    return datetime.datetime(*date, tzinfo=BERLIN).timestamp()  # type: ignore[misc]


def restarts(at: str, begin_s: float, hours: float, step_s: float = 60.0) -> list[str]:
    """Returns the local times of the restarts while both clocks run at the same rate."""
    nightly = NightlyRestart(at, 0.0)
    times = [number * step_s for number in range(int(hours * HOUR_S / step_s))]
    due = [begin_s + seconds for seconds in times if nightly.is_due(seconds, begin_s + seconds)]
    return [datetime.datetime.fromtimestamp(each, BERLIN).strftime("%d %H:%M") for each in due]


def test_restart_is_due_each_night() -> None:
    assert restarts("04:00", unix_s(2026, 6, 1, 18, 0), 72) == ["02 04:00", "03 04:00", "04 04:00"]


def test_restart_past_midnight() -> None:
    assert restarts("23:45", unix_s(2026, 6, 1, 18, 0), 24, step_s=2400.0) == ["02 00:00"]


def test_hour_that_summer_skips_is_replaced_by_the_next() -> None:
    assert restarts("02:30", unix_s(2026, 3, 28, 18, 0), 24) == ["29 03:00"]


def test_hour_that_winter_repeats_restarts_once() -> None:
    assert restarts("02:30", unix_s(2026, 10, 24, 18, 0), 24) == ["25 02:30"]


def test_no_time_is_never_due() -> None:
    assert restarts("", unix_s(2026, 6, 1, 18, 0), 72) == []


def test_start_at_the_time_of_day_is_no_reason_to_restart() -> None:
    assert restarts("04:00", unix_s(2026, 6, 1, 4, 0), 2) == []


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=200))
def test_jumps_of_the_clock_cause_at_most_a_restart_in_three_hours(jumps_s) -> None:
    nightly = NightlyRestart("04:00", 0.0)
    base = unix_s(2026, 6, 1, 18, 0)
    due = [
        number * 600.0
        for number, jump_s in enumerate(jumps_s)
        if nightly.is_due(number * 600.0, base + abs(jump_s))
    ]
    assert all(later - earlier >= 3 * HOUR_S for earlier, later in zip([0.0, *due], due, strict=False))


@pytest.mark.parametrize("text", ["4:00", "24:00", "04:60", "noon", "04:00:00", "٠٤:٠٠"])
def test_wrong_time_of_day_is_refused(text) -> None:
    with pytest.raises(InputError, match="not a time of day"):
        parse_time_of_day(text)
