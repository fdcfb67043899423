"""Tests that a performer's poses do not depend on position and heading."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document.clip import Clip, joint_places
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.examples.performer import extract_performer_clip
from enliven.rotation import from_rotation_vector, multiply, rotate

NAMES = ("hips", "chest", "hand", "foot")


def clip_of(seed):
    rng = np.random.default_rng(seed)
    skeleton = Skeleton(NAMES, np.array([-1, 0, 1, 0], np.int32), rng.normal(size=(4, 3)))
    turns = from_rotation_vector(np.cumsum(0.1 * rng.normal(size=(40, 4, 3)), axis=0))
    return Clip("take", skeleton, turns, rng.normal(size=(40, 3)), 0.02)


@given(st.integers(0, 10**6), st.floats(-9, 9), st.lists(st.floats(-9, 9), min_size=3, max_size=3))
@settings(max_examples=30, deadline=None)
def test_poses_do_not_know_where_one_stands_and_looks(seed, angle, moved):
    clip = clip_of(seed)
    turn = from_rotation_vector(np.array([0.0, angle, 0.0]))
    other = Clip("take", clip.skeleton, multiply(turn, clip.turns), rotate(turn, clip.root) + moved, 0.02)
    here, there = extract_performer_clip(clip, NAMES[1:]), extract_performer_clip(other, NAMES[1:])
    np.testing.assert_allclose(there.poses, here.poses, atol=1e-9)
    np.testing.assert_allclose(np.diff(there.yaw), np.diff(here.yaw), atol=1e-9)


def test_places_are_those_of_the_bones_one_by_one():
    clip = clip_of(1)
    places = joint_places(clip)
    for f in (0, 17):
        at = [clip.root[f]]
        for j in (1, 2, 3):
            at.append(at[clip.skeleton.parents[j]] + rotate(clip.turns[f, j], clip.skeleton.vectors[j]))
        np.testing.assert_allclose(places[f], at, atol=1e-12)
    with pytest.raises(InputError, match="wing"):
        extract_performer_clip(clip, ("wing",))
