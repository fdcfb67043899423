"""Tests of q(s, t): the kernel against the definition in plain steps, its ends, its knots, its times."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_strategies import EYE, angle, random_clip, random_skeleton, random_turn, seeds
from polylines import compute_knot_rotations, sample_rotations

from enliven.document.layers import Layer
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.motion.layers.polyline import Polyline, arc_lengths
from enliven.motion.layers.timing import LayerClocks
from enliven.rotation import conjugate, multiply, slerp

laws = settings(deadline=None, max_examples=40)


def plain_q(clip, chain, s, frame, weight, basis, mirrored):
    """Returns one rotation at one position and time, by the definition of AniMesh 5.1."""
    skeleton = clip.skeleton
    low = int(np.floor(frame))
    high = min(low + 1, len(clip.turns) - 1)
    world = [slerp(clip.turns[low, j], clip.turns[high, j], frame - low) for j in range(len(skeleton))]
    if len(chain) == 1:
        lengths, whole = [1.0], [world[chain[0]]]
    else:
        down = all(skeleton.parents[b] == a for a, b in itertools.pairwise(chain))
        base = world[chain[0] if down else 0]
        lengths, whole = [], []
        for a, b in itertools.pairwise(chain):
            lengths.append(np.linalg.norm(skeleton.positions[a] - skeleton.positions[b]))
            bone = b if skeleton.parents[b] == a else a
            whole.append(multiply(conjugate(base), world[bone]))
    # With a weight, each bone's rotation relative to the previous one is scaled.
    steps = [whole[0]] + [multiply(conjugate(a), b) for a, b in itertools.pairwise(whole)]
    at, knots = EYE, [EYE]
    for step in steps:
        at = multiply(at, slerp(EYE, step, weight))
        knots.append(at)
    arc = np.concatenate([[0.0], np.cumsum(lengths)]) / np.sum(lengths)
    for i in range(len(lengths)):
        if s <= arc[i + 1] or i == len(lengths) - 1:
            q = slerp(knots[i], knots[i + 1], (s - arc[i]) / (arc[i + 1] - arc[i]))
            break
    if mirrored:
        q = q * [1, 1, -1, -1]
    return multiply(multiply(basis, q), conjugate(basis))


@laws
@given(seeds, st.floats(0, 1), st.floats(0, 8), st.sampled_from([0.0, 0.3, 1.0]), st.booleans())
def test_the_kernel_is_the_definition(seed, s, frame, weight, mirrored):
    rng = np.random.default_rng(seed)
    skeleton = random_skeleton(rng, 9)
    clip = random_clip(rng, skeleton)
    chain = skeleton.path(*rng.integers(0, 9, 2).tolist())
    basis = random_turn(rng)
    ours = sample_rotations(Polyline.from_clip(clip, chain), [s], [frame], weight, basis, mirrored)[0, 0]
    assert angle(ours, plain_q(clip, chain, s, frame, weight, basis, mirrored)) < 1e-9


@laws
@given(seeds)
def test_a_chain_up_the_tree_is_measured_against_the_root(seed):
    rng = np.random.default_rng(seed)
    skeleton = random_skeleton(rng, 7, branching=0.0)
    clip = random_clip(rng, skeleton)
    line = Polyline.from_clip(clip, (6, 5, 4, 3))
    expected = multiply(conjugate(clip.turns[:, 0]), clip.turns[:, 4])
    assert angle(sample_rotations(line, [1.0], np.arange(9))[:, 0], expected) < 1e-9


@laws
@given(seeds)
def test_neighbouring_knots_have_one_sign(seed):
    rng = np.random.default_rng(seed)
    skeleton = random_skeleton(rng, 9)
    knots = compute_knot_rotations(
        Polyline.from_clip(random_clip(rng, skeleton), skeleton.path(0, 8)), np.linspace(0, 8, 30)
    )
    assert ((knots[:, 1:] * knots[:, :-1]).sum(-1) >= 0).all()
    assert np.abs(np.linalg.norm(knots, axis=-1) - 1).max() < 1e-12


def test_a_bone_without_length_keeps_its_turn_to_itself():
    at = np.array([[0, 0, 0], [0, 1, 0], [0, 1, 0], [0, 2, 0]], float)
    skeleton = Skeleton(("a", "b", "c", "d"), np.array([-1, 0, 1, 2], np.int32), at)
    arc = arc_lengths(skeleton, (0, 1, 2, 3))
    assert (np.diff(arc) > 0).all() and arc[-1] == 1.0
    clip = random_clip(np.random.default_rng(1), skeleton)
    q = sample_rotations(Polyline.from_clip(clip, (0, 1, 2, 3)), arc, np.arange(9))
    for j in (1, 2, 3):
        relative = multiply(conjugate(clip.turns[:, 0]), clip.turns[:, j])
        assert angle(q[:, j], relative) < 1e-9
    assert np.array_equal(arc_lengths(Skeleton(("a", "b"), [-1, 0], np.zeros((2, 3))), (0, 1)), [0.0, 1.0])


@pytest.mark.parametrize(
    ("played", "seconds", "expected"),
    [
        ({}, 0.1, 3.0),
        ({}, -5.0, 0.0),
        ({}, 99.0, 8.0),
        ({"offset": 0.1}, 0.2, 3.0),
        ({"speed": 2.0}, 0.1, 6.0),
        ({"speed": -1.0}, 0.0, 8.0),
        ({"speed": -1.0}, 0.1, 5.0),
        ({"speed": -1.0}, 99.0, 0.0),
        ({"loop": True}, 8 / 30 + 0.1, 3.0),
        ({"loop": True, "speed": -1.0}, 0.1, 5.0),
        ({"loop": True, "speed": -1.0}, 8 / 30 + 0.1, 5.0),
        ({"loop": True, "offset": 0.1}, 0.0, 5.0),
    ],
)
def test_layer_time_is_clamped_and_looped(played, seconds, expected):
    clip = random_clip(np.random.default_rng(0), random_skeleton(np.random.default_rng(0), 3))
    clocks = LayerClocks.from_layers([Layer("layer", "take", (0,), **played)], [clip])
    assert clocks.frames_at(np.array([seconds]))[0][0] == pytest.approx([expected], abs=1e-9)


def test_one_frame_is_played_for_ever():
    clip = random_clip(np.random.default_rng(0), random_skeleton(np.random.default_rng(0), 3), frames=1)
    layer = Layer("layer", "take", (0, 1), loop=True, speed=-3.0)
    frames, _, _, rounds, _ = LayerClocks.from_layers([layer], [clip]).frames_at(np.array([-1.0, 0.0, 7.0]))
    assert not frames.any() and not rounds.any()
    knots = compute_knot_rotations(Polyline.from_clip(clip, (0, 1)), [0.0])
    assert angle(knots[0, 1], multiply(conjugate(clip.turns[0, 0]), clip.turns[0, 1])) < 1e-9


@pytest.mark.parametrize(
    ("chain", "said"),
    [((), "no joint"), ((0, 9), "joint 9 does not exist"), ((0, 2), "not neighbours"), ((0, 1, 0), "twice")],
)
def test_invalid_chain_is_refused(chain, said):
    skeleton = Skeleton(("a", "b", "c"), np.array([-1, 0, 1], np.int32), np.eye(3))
    clip = random_clip(np.random.default_rng(0), skeleton)
    with pytest.raises(InputError, match=said):
        Polyline.from_clip(clip, chain)
