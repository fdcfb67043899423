"""Tests of the values of the last day: means per minute, gaps, clock changes, and the file."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import pytest

from enliven.health_page.charts import HEIGHT, WIDTH, draw_chart
from enliven.health_page.history import CAPACITY_MINUTES, MAX_SERIES, DayHistory

START_S = 1_800_000_000.0


def filled(minutes: int) -> DayHistory:
    """Returns a history with the values 0, 1, 2, ... of one series, one per minute."""
    history = DayHistory()
    for minute in range(minutes + 1):
        history.add(START_S + 60.0 * minute, {"a": float(minute)})
    return history


def test_the_mean_of_each_minute_is_stored():
    history = DayHistory()
    for second in range(60):
        history.add(START_S + second, {"a": float(second), "b": None, "c": math.nan})
    assert history.add(START_S + 60.0, {}) and history.names == ["a"]
    assert history.read("a", START_S)[-1] == pytest.approx(29.5)
    assert math.isnan(history.read("a", START_S)[-2])


def test_only_the_last_day_is_kept():
    history = filled(3 * CAPACITY_MINUTES)
    values = history.read("a", START_S + 60.0 * (3 * CAPACITY_MINUTES - 1))
    assert values == [float(value) for value in range(2 * CAPACITY_MINUTES, 3 * CAPACITY_MINUTES)]


def test_values_can_be_averaged_over_several_minutes():
    history = filled(CAPACITY_MINUTES)
    values = history.read("a", START_S + 60.0 * (CAPACITY_MINUTES - 1), 240)
    assert len(values) == 240 and values[0] == pytest.approx(2.5) and values[-1] == pytest.approx(1436.5)


def test_a_jump_of_the_clock_leaves_a_gap():
    history = filled(10)
    history.add(START_S + 86_400.0 * 400, {"a": 99.0})
    history.add(START_S + 86_400.0 * 400 + 60.0, {})
    ahead = history.read("a", START_S + 86_400.0 * 400)
    assert ahead[-1] == 99.0 and all(math.isnan(value) for value in ahead[:-1])
    history.add(START_S + 600.0, {"a": 10.0})
    history.add(START_S + 660.0, {})
    behind = history.read("a", START_S + 600.0)
    assert behind[-1] == 10.0 and behind[-2] == 9.0


def test_a_file_keeps_the_values(tmp_path: Path):
    path = tmp_path / "new" / "history"
    filled(20).save(path)
    history = DayHistory()
    history.load(path)
    assert history.read("a", START_S + 1200.0)[-3:] == [18.0, 19.0, 20.0]


@pytest.mark.parametrize("damage", ["cut", "empty", "other", "version", "length", "missing"])
def test_a_damaged_file_is_ignored(tmp_path: Path, damage: str):
    path = tmp_path / "history"
    filled(20).save(path)
    data = path.read_bytes()
    content = msgspec.msgpack.decode(data)
    if damage == "missing":
        path.unlink()
    else:
        path.write_bytes(
            {
                "cut": data[: len(data) // 2],
                "empty": b"",
                "other": b"\x93\x01\x02\x03",
                "version": msgspec.msgpack.encode({**content, "version": 2}),
                "length": msgspec.msgpack.encode({**content, "series": {"a": b"1234"}}),
            }[damage]
        )
    history = DayHistory()
    history.load(path)
    assert history.names == [] and history.add(START_S, {"a": 1.0}) is False
    history.save(path)
    again = DayHistory()
    again.load(path)
    assert again.names == ["a"]


def test_the_number_of_series_is_limited():
    history = DayHistory()
    history.add(START_S, {str(number): 1.0 for number in range(2 * MAX_SERIES)})
    history.add(START_S + 60.0, {})
    assert len(history.names) == MAX_SERIES


def test_a_chart_has_gaps_and_its_range():
    chart = draw_chart("load", "", [1.0, math.nan, 3.0, 2.0])
    assert chart.path.count("M") == 2 and chart.path.count("L") == 1
    assert (chart.low, chart.high, chart.last) == (1.0, 3.0, 2.0)
    numbers = [
        float(word) for word in chart.path.replace("M", " ").replace("L", " ").replace("H", " ").split()
    ]
    assert min(numbers) >= 0.0 and max(numbers) <= max(WIDTH, HEIGHT)


def test_charts_without_values_or_with_equal_ones_are_drawn():
    assert draw_chart("load", "", [math.nan] * 5).path == ""
    assert draw_chart("load", "", [0.0, 0.0]).path.startswith("M0.0 38.0")
