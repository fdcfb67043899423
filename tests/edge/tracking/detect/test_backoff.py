"""Tests of back-off: failed attempts become increasingly rare, but follow at once if the fit gets worse."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from enliven_edge.tracking.detect.backoff import Backoff


def frames_between(backoff: Backoff, badness: float, trials: int) -> list[int]:
    """Returns the number of frames before each of several failed attempts."""
    gaps = []
    for _ in range(trials):
        waited = 1
        while not backoff.is_due(badness):
            waited += 1
        gaps.append(waited)
        backoff.record(badness, better=False)
    return gaps


def test_backoff_doubles_up_to_its_maximum():
    assert frames_between(Backoff(6), 0.3, 6) == [1, 2, 4, 6, 6, 6]


def test_successful_method_is_tried_in_every_bad_frame():
    backoff = Backoff(8)
    frames_between(backoff, 0.3, 5)
    assert not backoff.is_due(0.3)
    backoff.record(0.3, better=True)
    assert backoff.is_due(0.3)


@given(st.floats(0.01, 1.0), st.floats(1.0, 3.0), st.integers(2, 20))
@settings(max_examples=50, deadline=None)
def test_clearly_worse_fit_is_retried_at_once(badness, times, longest):
    backoff = Backoff(longest, worse=1.5)
    frames_between(backoff, badness, 10)
    assert backoff.is_due(times * badness) == (times * badness > 1.5 * badness)
