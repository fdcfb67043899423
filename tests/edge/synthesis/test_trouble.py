"""Tests of simulated stream faults: they invent no data, and a frame keeps its ground truth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.camera import Intrinsics
from enliven.frames import DepthFrame
from enliven_synthesis.sensor import stream_faults

CAMERA = Intrinsics(40, 30, 35.0, 35.0, 19.5, 14.5)


def frames(count: int) -> list[tuple[DepthFrame, int]]:
    """Returns numbered frames at 30 per second, each with a constant depth of its own."""
    return [
        (DepthFrame(np.full((30, 40), 1000 + n, np.uint16), CAMERA, n * 33_333_333, "s"), n)
        for n in range(count)
    ]


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 200), st.floats(0.0, 0.9), st.integers(0, 50))
def test_lost_and_late_frames_are_those_that_were(count: int, part: float, seed: int) -> None:
    sent = frames(count)
    for got in (stream_faults.drop_frames(sent, part, seed), stream_faults.reorder_frames(sent, part, seed)):
        assert all(sent[n] == (frame, n) for frame, n in got)
        assert len({n for _, n in got}) == len(got)
    assert sorted(n for _, n in stream_faults.reorder_frames(sent, part, seed)) == list(range(count))
    assert [n for _, n in stream_faults.drop_frames(sent, part, seed)] == sorted(
        n for _, n in stream_faults.drop_frames(sent, part, seed)
    )


def test_late_frames_are_at_most_three_places_late() -> None:
    order = [n for _, n in stream_faults.reorder_frames(frames(300), 0.2, 1)]
    assert order != sorted(order)
    places = np.empty(300, int)
    places[order] = np.arange(300)
    assert (places - np.arange(300)).max() <= 3


def test_a_slow_sensor_keeps_its_pace() -> None:
    times = [f.time_ns * 1e-9 for f, _ in stream_faults.slow_frames(frames(300), 5.0)]
    assert np.diff(times) == pytest.approx(0.2, abs=1e-3)


def test_a_frozen_sensor_repeats_its_last_image_under_new_times() -> None:
    got = stream_faults.freeze_frames(frames(90), 1.0, 2.0)
    values = [int(f.depth[0, 0]) - 1000 for f, _ in got]
    assert (
        values[:30] == list(range(30))
        and set(values[31:60]) == {values[31]}
        and values[61:] == list(range(61, 90))
    )
    assert all(np.diff([f.time_ns for f, _ in got]) > 0)


def test_a_covered_lens_shows_nothing_for_a_while() -> None:
    got = stream_faults.cover_lens(frames(90), 1.0, 2.0)
    dark = [not f.depth.any() for f, _ in got]
    assert dark.index(True) == 31 and 29 <= sum(dark) <= 30 and not dark[-1]


@pytest.mark.parametrize("part", [0.1, 0.4, 0.8])
def test_holes_take_as_much_as_is_asked(part: float) -> None:
    got = stream_faults.remove_depth(frames(40), part)
    assert np.mean([(f.depth == 0).mean() for f, _ in got]) == pytest.approx(part, abs=0.05)
    assert all(set(np.unique(f.depth)) <= {0, 1000 + n} for f, n in got)
