"""Tests of bone rotations from joint positions: the kernel against plain NumPy, and special cases."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_strategies import EYE, angle, random_skeleton, random_turn, seeds
from tolerances import are_alike

from enliven.document.skeleton import Skeleton
from enliven.motion_clips.joint_positions import fill_unseen, rest_from_positions, rotations_from_positions
from enliven.rotation import from_matrix, from_rotation_vector, multiply, rotate, swing

laws = settings(deadline=None, max_examples=40)


def direction(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def plain_turns(skeleton, positions, known):
    """Computes one frame, joint by joint, with the functions of enliven.rotation."""
    turns = np.empty((len(skeleton), 4))
    for j, parent in enumerate(skeleton.parents):
        below = list(skeleton.children[j])
        if parent < 0:
            links = positions[below] - positions[j]
            if known is not None:
                turns[j] = known[j]
            elif len(below) > 1:
                turns[j] = from_matrix(links.T @ skeleton.vectors[below])
            else:
                turns[j] = swing(direction(skeleton.vectors[below[0]]), direction(links[0]))
            continue
        before = turns[parent] if known is None else known[j]
        carried = rotate(before, direction(skeleton.vectors[j]))
        turns[j] = multiply(swing(carried, direction(positions[j] - positions[parent])), before)
        if known is None and len(below) > 1:
            axis = rotate(turns[j], direction(skeleton.vectors[j]))
            sine = cosine = 0.0
            for child in below:
                a = rotate(turns[j], skeleton.vectors[child])
                b = positions[child] - positions[j]
                a, b = a - (a @ axis) * axis, b - (b @ axis) * axis
                sine, cosine = sine + np.cross(a, b) @ axis, cosine + a @ b
            turns[j] = multiply(from_rotation_vector(axis * np.arctan2(sine, cosine)), turns[j])
    return turns


@laws
@given(seeds, st.booleans())
def test_the_kernel_is_the_definition(seed, oriented):
    rng = np.random.default_rng(seed)
    skeleton = random_skeleton(rng, 9)
    positions = skeleton.positions + rng.normal(size=(3, 9, 3)) * 0.3
    orientations = np.array([[random_turn(rng) for _ in range(9)] for _ in range(3)]) if oriented else None
    ours = rotations_from_positions(skeleton, positions, orientations)
    for f in range(3):
        assert (
            angle(
                ours[f],
                plain_turns(skeleton, positions[f], None if orientations is None else orientations[f]),
            )
            < 1e-6
        )


def test_coincident_joints_keep_parent_rotation():
    at = np.array([[0, 1.0, 0], [0, 2, 0], [0, 2, 0], [0, 3, 0]])
    skeleton = Skeleton(tuple("abcd"), np.array([-1, 0, 1, 2], np.int32), at)
    now = np.array([[0, 1.0, 0], [1, 1, 0], [1, 1, 0], [1, 1, 0]])
    turns = rotations_from_positions(skeleton, now[None])[0]
    assert angle(turns[1:], np.tile(turns[0], (3, 1))) < 1e-9
    np.testing.assert_allclose(rotate(turns[1], [0, 1, 0]), [1, 0, 0], atol=1e-12)
    alone = Skeleton(("a",), np.array([-1], np.int32), np.zeros((1, 3)))
    assert are_alike(rotations_from_positions(alone, np.ones((2, 1, 3))), np.tile(EYE, (2, 1, 1)))


@laws
@given(seeds)
def test_bones_at_rest_are_as_long_as_they_mostly_are(seed):
    rng = np.random.default_rng(seed)
    skeleton = random_skeleton(rng, 7)
    frames = skeleton.positions + rng.normal(size=(9, 7, 3)) * 0.05
    rest = rest_from_positions(skeleton.parents, skeleton.positions, frames)
    for j, parent in enumerate(skeleton.parents[1:], 1):
        link = rest[j] - rest[parent]
        wanted = np.median(np.linalg.norm(frames[:, j] - frames[:, parent], axis=1))
        np.testing.assert_allclose(link, wanted * direction(skeleton.vectors[j]), atol=1e-9)


def test_never_visible_joints_keep_initial_rotation():
    positions = np.arange(24.0).reshape(4, 2, 3)
    seen = np.array([[True, False]] * 4)
    np.testing.assert_array_equal(fill_unseen([-1, 0], positions, seen), positions)
