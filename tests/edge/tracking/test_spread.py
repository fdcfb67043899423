"""Tests that the search for people is spread over frames: no frame is slow, and the result is the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.frames import DepthFrame
from enliven.recording import Recording
from enliven_edge.doctor import find_shipped_recording
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.settings import SearchSettings, TrackerSettings
from enliven_edge.tracking.tracker import Tracker
from enliven_edge.tracking.work_budget import Budget, BudgetedTask, frame_budget, run_to_end

FITS = 12
"""Number of coarse fits per frame, fewer than the default, so that a search takes more frames."""
FOLLOWING = 9
"""Maximum number of coarse fits for following a person without a search.

It counts two fits, arm recovery, the network's proposal, the present fit, one after a turn, and two that
bring a result to this frame.
"""
COARSE = 9
"""Number of evaluations of all terms in a coarse fit: eight steps and the initial posture."""
PART = 2
"""Number of coarse fits in the largest indivisible part of a search, half a refinement. It is the maximum
overrun.
"""
AT_ONCE = TrackerSettings(search=SearchSettings(fits_per_frame=0))
SPREAD = TrackerSettings(search=SearchSettings(fits_per_frame=FITS, first_fits=FITS))


def parts(costs):
    """Yields the costs of parts of some work. Returns their number."""
    yield from costs
    return len(costs)


@given(st.lists(st.integers(1, 6), max_size=30), st.floats(0.5, 20.0))
@settings(max_examples=60, deadline=None)
def test_no_frame_costs_more_than_its_budget_and_one_part(costs, fits):
    spread, spent = BudgetedTask(parts(costs)), 0.0
    for _ in range(200):
        budget = Budget(fits)
        done = spread.advance(budget)
        assert fits - budget.remaining < fits + max(costs, default=0)
        spent += fits - budget.remaining
        if done:
            break
    assert spread.result == run_to_end(parts(costs)) == len(costs)
    assert spent == pytest.approx(sum(costs))


@pytest.mark.parametrize(("rate", "fits"), [(60, 24), (30, 24), (15, 48), (5, 144), (None, 24)])
def test_a_search_takes_as_long_where_frames_are_rare(rate, fits):
    assert frame_budget(24, rate and 1 / rate).remaining == pytest.approx(fits)
    assert frame_budget(0, rate and 1 / rate).remaining == np.inf


@pytest.fixture(scope="module")
def film() -> list[DepthFrame]:
    """Returns two seconds of the shipped recording with a person from the first frame on."""
    frames = (f for f in Recording(find_shipped_recording()).frames() if isinstance(f, DepthFrame))
    return [frame for _, frame in zip(range(60), frames, strict=False)]


def counted(frames, settings, monkeypatch):
    """Returns (work in coarse fits, bodies) of every frame, from the fits' steps and points."""
    fit, counts = Fitter.fit, []
    calls = [0.0]

    def counting(fitter, observation, start, **options):
        steps = options.get("iterations") or fitter.settings.iterations
        calls[0] += (steps + 1) / COARSE * (0.3 + 0.7 * len(observation.points) / fitter.settings.points)
        return fit(fitter, observation, start, **options)

    monkeypatch.setattr(Fitter, "fit", counting)
    tracker = Tracker(settings)
    for frame in frames:
        calls[0] = 0.0
        bodies = tracker.track(frame)
        counts.append((calls[0], bodies))
    return counts


@pytest.mark.slow
def test_the_fits_of_every_frame_are_bounded(film, monkeypatch):
    spread = counted(film, SPREAD, monkeypatch)
    appeared = next(n for n, (_, bodies) in enumerate(spread) if bodies)
    assert max(work for work, _ in spread[:appeared]) <= FITS + PART
    assert max(work for work, _ in spread[appeared:]) <= FITS + PART + FOLLOWING
    at_once = [work for work, _ in counted(film, AT_ONCE, monkeypatch)]
    assert at_once[0] > FITS + PART, "nothing had to be spread"


@pytest.mark.parametrize("step", [1, 3], ids=["30 a second", "10 a second"])
@pytest.mark.parametrize("made", [TrackerSettings(), AT_ONCE], ids=["spread", "at once"])
def test_person_in_the_first_frame_is_reported_in_it(film, made, step):
    tracker = Tracker(made)
    assert [len(tracker.track(frame)) for frame in film[::step]] == [1] * len(film[::step])


@pytest.mark.parametrize("empty", [1, 10])
def test_first_search_waits_for_a_sensor_that_starts(film, empty):
    """Empty depth images from a starting sensor do not use up its first search."""
    tracker, nothing = Tracker(), np.zeros_like(film[0].depth)
    for n, frame in enumerate(film[: empty + 3]):
        bodies = tracker.track(replace(frame, depth=nothing) if n < empty else frame)
        assert len(bodies) == (n >= empty), f"frame {n}"


def test_first_search_has_its_larger_budget_once(film, monkeypatch):
    """Only one frame has the larger budget. Later searches are spread over frames."""
    limits = TrackerSettings(search=SearchSettings(fits_per_frame=FITS))
    work = [calls for calls, _ in counted(film, limits, monkeypatch)]
    assert FITS + PART < work[0] <= limits.search.first_fits + PART
    assert max(work[1:]) <= FITS + PART + FOLLOWING


@pytest.mark.slow
def test_incremental_search_matches_single_search(film):
    """When the person appears, joints agree to four centimetres, and soon afterwards to one.

    Arm recovery may run in another frame, so one joint may differ for some frames.
    """
    spread, at_once = (Tracker(options) for options in (SPREAD, AT_ONCE))
    errors = []
    for frame in film:
        mine, theirs = spread.track(frame), at_once.track(frame)
        if mine:
            errors.append(np.linalg.norm(mine[0].joints - theirs[0].joints, axis=1).max())
    assert len(errors) > 50
    assert max(errors[:5]) < 0.04
    assert max(errors) < 0.08
    assert np.median(errors[15:]) < 0.01


def test_entering_person_is_found_at_its_position(stagecraft):
    """A body found in an earlier frame is moved to the newest frame."""
    s = stagecraft
    walker = s.Player(s.line((1.6, -2.6), (-1.4, -2.6), 0.3, 2.0), "walk")
    playground, tracker, first = s.Playground(walker), Tracker(SPREAD), None
    for i in range(60):
        bodies = tracker.track(playground.frame(i / 30))
        if bodies and first is None:
            first = np.linalg.norm(bodies[0].joints - playground.joints(i / 30)[0], axis=1)
    assert first is not None
    assert np.median(first) < 0.06
    assert first.max() < 0.35


@pytest.mark.slow
def test_searched_person_is_not_learnt_as_background(film):
    """During a search of a fifth of a second, the person's pixels are not learnt as background."""
    tracker = Tracker(TrackerSettings(search=SearchSettings(fits_per_frame=1, first_fits=1)))
    at_once = Tracker(AT_ONCE)
    tracked = [(tracker.track(frame), at_once.track(frame)) for frame in film]
    appeared = next(n for n, (mine, _) in enumerate(tracked) if mine)
    assert 5 < appeared < 15
    for mine, theirs in tracked[appeared + 3 :]:
        assert np.linalg.norm(mine[0].joints - theirs[0].joints, axis=1).max() < 0.05
