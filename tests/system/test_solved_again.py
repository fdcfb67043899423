"""Tests that solving a recorded performance again on the same mesh gives the same result."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from performed_take import chair_actor, record_performance
from swaying import without_cache

from enliven.modeling.possessed.solving import has_missing_motion, solve_again, stale
from enliven.motion_clips.recorded_characters import read_possessed
from enliven.possession import ActorSettings
from enliven.wire import Possess, Release
from enliven.wire.quantize import POSITION_ERROR

LINEAR = 6e-3
"""Maximum error of an entry of a linear part. The wire rounds rotations by 0.85 mrad and stretches by sqrt(3)
0.001.
"""
FRAMES = 40
parts = st.sampled_from(["all", "legs", "upper body", "hip + right arm"])
modes = st.sampled_from(["alone", "join", "extend"])
orders = st.one_of(
    st.builds(lambda who, p, m: Possess("chair", who, p, m), st.sampled_from([1, 2]), parts, modes),
    st.builds(lambda who: Release("chair", who), st.sampled_from([None, 1, 2])),
)
hows = st.fixed_dictionaries(
    {
        "how": st.sampled_from(["inside", "beside", "mapped"]),
        "place": st.sampled_from(["meet", "meet", "fixed"]),
        "scaled": st.sampled_from(["mesh", "performer", "nobody"]),
        "travel": st.sampled_from([1.0, 0.5]),
        "fade": st.sampled_from([0.0, 0.3]),
        "hand_over": st.sampled_from([0.0, 0.4]),
    }
)


@settings(max_examples=8, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(
    how=hows,
    given_orders=st.dictionaries(st.integers(2, 30), st.lists(orders, max_size=2), min_size=1, max_size=4),
    absent=st.tuples(st.integers(5, 20), st.integers(0, 18)),
    late=st.integers(0, 3),
    seed=st.integers(0, 99),
)
@pytest.mark.slow
def test_solving_again_on_the_same_mesh_equals_the_recording(how, given_orders, absent, late, seed):
    """For any attachments and settings, leaving and returning performers, and hand-overs."""
    first, gone = absent
    away = 0.0 if how["place"] == "fixed" else 2.5
    seen = [set() if n < late else {2} if first <= n < first + gone else {1, 2} for n in range(FRAMES)]
    begin = Possess("chair", 1, "all", "alone")
    given_orders = {**given_orders, late + 1: (begin, *given_orders.get(late + 1, ()))}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "take.mcap"
        record_performance(path, seen, given_orders, [chair_actor(ActorSettings(**how))], seed, away)
        project = read_possessed(path)
    assert_solved_again_is_what_was_recorded(project, "chair")


def test_characters_side_by_side_and_a_hold_that_is_taken_over(tmp_path):
    """Waiting positions and hand-overs are read from the recording, because they depend on the other
    characters.
    """
    how = ActorSettings(how="beside", fade=0.2, hand_over=0.3)
    actors = [chair_actor(how), chair_actor(how, name="twin")]
    requests_at = {3: (Possess("twin", 2, "all"),), 6: (Possess("chair", 1, "upper body"),)}
    present = [{1, 2} if n < 12 else {1, 3} for n in range(36)]
    assert not record_performance(tmp_path / "take.mcap", present, requests_at, actors)
    project = read_possessed(tmp_path / "take.mcap")
    holds = {name: project.graph(name).parts[0].possession.holds for name in ("chair", "twin")}
    assert [(h.mode, h.performer, h.former) for h in holds["twin"]] == [
        ("alone", 2, None),
        ("take over", 3, 2),
    ]
    assert [(h.mode, h.performer) for h in holds["chair"]] == [("alone", 1)]
    for name in holds:
        assert_solved_again_is_what_was_recorded(project, name)


def assert_solved_again_is_what_was_recorded(project, name):
    shape = project.graph(name)
    assert not stale(project, shape) and not has_missing_motion(shape)
    recorded = project.streams[shape.parts[0].take]
    damaged = without_cache(project, name)
    assert stale(damaged, damaged.graph(name)) and has_missing_motion(damaged.graph(name))
    again = solve_again(damaged, name)
    solved = again.streams[again.graph(name).parts[0].take]
    assert solved.step == recorded.step and len(again.streams) == len(project.streams)
    np.testing.assert_allclose(solved.positions, recorded.positions, atol=POSITION_ERROR + 1e-6)
    np.testing.assert_allclose(solved.linear, recorded.linear, atol=LINEAR)
    assert not stale(again, again.graph(name))
