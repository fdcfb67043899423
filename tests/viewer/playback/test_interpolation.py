"""Tests of interpolating transforms: rotations stay rotations, ends are exact, and the angular speed is
constant.
"""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from enliven.document.character import Pose
from enliven.person.body import Body
from enliven_viewer.playback.interpolation import blend_bodies, blend_linear, blend_poses

seeds = st.integers(0, 10_000)


def rotations(seed: int, count: int = 5) -> np.ndarray:
    return Rotation.random(count, rng=seed).as_matrix()


@given(seeds, st.floats(0, 1))
@settings(deadline=None, max_examples=60)
def test_rotations_are_slerped(seed: int, share: float) -> None:
    first = rotations(seed)
    last = first @ Rotation.from_rotvec(np.random.default_rng(seed).uniform(-1.7, 1.7, (5, 3))).as_matrix()
    expected = [
        Slerp([0, 1], Rotation.from_matrix(np.stack([a, b])))(share).as_matrix()
        for a, b in zip(first, last, strict=True)
    ]
    assert np.allclose(blend_linear(first, last, share), expected, atol=1e-7)


@given(seeds)
@settings(deadline=None, max_examples=40)
def test_the_ends_are_kept_for_any_map(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, last = rng.normal(0, 1, (2, 6, 3, 3))
    assert np.allclose(blend_linear(first, last, 0.0), first, atol=1e-9)
    assert np.allclose(blend_linear(first, last, 1.0), last, atol=1e-9)


@given(seeds, st.floats(0, 1), st.floats(0.2, 5), st.floats(0.2, 5))
@settings(deadline=None, max_examples=40)
def test_stretch_is_blended_evenly(seed: int, share: float, small: float, large: float) -> None:
    turn = rotations(seed)
    blend = blend_linear(turn * small, turn * large, share)
    assert np.allclose(blend, turn * (small + share * (large - small)), atol=1e-7)


def test_maps_without_a_rotation_are_blended_plainly() -> None:
    first, last = np.zeros((1, 3, 3)), np.diag([1.0, 1.0, -1.0])[None]
    assert np.allclose(blend_linear(first, last, 0.5), last / 2)


def test_poses_of_different_characters_are_not_mixed() -> None:
    def pose(count: int) -> Pose:
        return Pose(
            "x", count, np.tile(np.eye(3, dtype=np.float32), (count, 1, 1)), np.zeros((count, 3), "f4")
        )

    assert len(blend_poses(pose(2), pose(3), 0.4, 0).linear) == 2
    assert len(blend_poses(pose(2), pose(3), 0.6, 0).linear) == 3


def test_bodies_are_blended_with_all_that_is_known_of_them() -> None:
    turns = Rotation.from_rotvec([[0.0, 0.0, 0.0], [0.0, 0.8, 0.0]]).as_quat(scalar_first=True)
    before, after = (
        Body(1, np.full((20, 3), x), np.ones(20), np.tile(turn, (20, 1)), np.array([x, 0.0]), 1.7 + x)
        for x, turn in zip((0.0, 1.0), turns, strict=True)
    )
    (blended,) = blend_bodies((before,), (after,), 0.25)
    assert blended.joints[3, 1] == 0.25 and blended.contacts[0] == 0.25 and blended.stature == 1.7
    angle = Rotation.from_quat(blended.orientations, scalar_first=True).magnitude()
    assert np.allclose(angle, 0.2)
    bare = Body(1, np.ones((20, 3)), np.ones(20))
    (mixed,) = blend_bodies((before,), (bare,), 0.75)
    assert mixed.orientations is None and mixed.contacts is None and mixed.stature is None
