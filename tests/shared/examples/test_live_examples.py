"""Tests that the frame-by-frame solution equals the batch solution, up to the effect of unknown future
frames.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import are_alike

from enliven.document.example_settings import ExampleSettings
from enliven.errors import InputError
from enliven.examples.live import LiveExamples
from enliven.examples.mapping import ExampleMap
from enliven.examples.poses import Examples

STEP = 1 / 30


def mapping_of(seed, **how):
    rng = np.random.default_rng(seed)
    names = ("a", "b")
    poses = rng.normal(size=(2, 5, 2, 3))
    return ExampleMap(Examples(names, names, poses[0], poses[1]), ExampleSettings(**how))


def waves(mapping, frames, seed):
    rng = np.random.default_rng(seed)
    t = np.arange(frames)[:, None, None] * STEP
    smooth = np.sin(t * rng.uniform(1, 6, (2, 3)) + rng.uniform(0, 6, (2, 3)))
    return smooth + 0.05 * rng.normal(size=smooth.shape)


def played(mapping, poses, lag):
    live = LiveExamples(mapping, STEP, lag)
    out = [place for pose in poses if (place := live.push(pose)) is not None]
    return np.concatenate([np.array(out).reshape(-1, 2, 3), live.finish()])


@given(st.integers(0, 10**6))
@settings(max_examples=8, deadline=None)
def test_within_the_lag_live_is_the_batch(seed):
    mapping = mapping_of(seed)
    poses = waves(mapping, 12, seed)
    np.testing.assert_allclose(played(mapping, poses, 12), mapping.solve(poses, STEP), atol=1e-8)


@given(st.integers(0, 10**6), st.integers(0, 5))
@settings(max_examples=8, deadline=None)
def test_without_the_acceleration_term_there_is_nothing_to_wait_for(seed, lag):
    mapping = mapping_of(seed, acceleration=0.0)
    poses = waves(mapping, 15, seed)
    np.testing.assert_allclose(played(mapping, poses, lag), mapping.solve(poses, STEP), atol=1e-9)


def test_the_longer_the_lag_the_nearer_the_batch():
    mapping = mapping_of(4)
    poses = waves(mapping, 90, 4)
    whole = mapping.solve(poses, STEP)
    off = [np.abs(played(mapping, poses, lag) - whole).max() for lag in (0, 3, 8, 25)]
    assert off[1] < 0.7 * off[0]
    assert off[2] < 0.2 * off[0]
    assert off[3] < 1e-3 * off[0]


def test_invalid_pose_is_ignored():
    mapping = mapping_of(2)
    poses = waves(mapping, 10, 2)
    live, other = LiveExamples(mapping, STEP, 2), LiveExamples(mapping, STEP, 2)
    for pose in poses:
        with pytest.raises(InputError, match="not finite"):
            live.push(pose * np.nan)
        ours, theirs = live.push(pose), other.push(pose)
        assert (ours is None) == (theirs is None)
        assert ours is None or are_alike(ours, theirs)
    assert are_alike(live.finish(), other.finish())
