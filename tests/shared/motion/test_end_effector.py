"""Tests of layers in the mode "end": the end of a chain is at the take's end position, scaled, in the
basis.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from layer_edits import set_layer
from motion_strategies import EYE, angle, random_clip, random_skeleton, random_turn, scene, seeds
from polylines import sample_rotations

from enliven.document.rigged import still_shape
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.motion.layers.evaluate import Player
from enliven.motion.layers.polyline import Polyline
from enliven.motion.layers.retarget import bind_chain
from enliven.rotation import conjugate, rotate

laws = settings(deadline=None, max_examples=30)


def posed(clip, chain):
    """Returns (F, K, 3) a take's chain from its first joint, relative to its parent bone."""
    at = np.zeros((len(clip.turns), len(chain), 3))
    base = conjugate(clip.turns[:, chain[0]])
    for i, joint in enumerate(chain[1:], 1):
        at[:, i] = at[:, i - 1] + rotate(base, rotate(clip.turns[:, joint], clip.skeleton.vectors[joint]))
    return at


def line(rng, joints, bend=0.3):
    """Returns a polyline with a length of about one and similar bones."""
    links = np.array([0.0, -0.2, 0.0]) + rng.normal(size=(joints, 3)) * 0.2 * bend
    names = tuple(f"j{i}" for i in range(joints))
    return Skeleton(names, np.arange(-1, joints - 1, dtype=np.int32), links.cumsum(0))


@laws
@given(seeds, st.integers(3, 9), st.booleans())
@pytest.mark.slow
def test_the_end_is_where_the_takes_is(seed, joints, mirrored):
    rng = np.random.default_rng(seed)
    source, target = line(rng, 5), line(rng, joints)
    clip, basis = random_clip(rng, source), random_turn(rng)
    project = scene(rng)[0].with_takes(clip).with_characters(still_shape("line", target))
    project = bind_chain(
        project, "line", range(joints), "take", range(5), basis=basis, mode="end", mirrored=mirrored
    )
    turns, at = Player(project, "line").sample(np.arange(9) * clip.step)
    scale = target.lengths.sum() / source.lengths.sum()
    way = posed(clip, range(5))[:, -1] * ([-1, 1, 1] if mirrored else [1, 1, 1])
    expected = at[:, 0] + scale * rotate(basis, way)
    # A curled take may be nearer than the target can fold; there it is as near as it can.
    whole, longest = target.lengths.sum(), target.lengths.max()
    far = np.linalg.norm(way, axis=1) * scale > max(0.3 * whole, 2 * longest - whole)
    assert np.abs(at[far, -1] - expected[far]).max(initial=0) < 1e-4 * target.lengths.sum()
    for j in range(1, joints):
        link = rotate(turns[:, j], target.vectors[j])
        np.testing.assert_allclose(at[:, j] - at[:, j - 1], link, atol=1e-9)


@laws
@given(seeds)
def test_retargeting_to_own_polyline_gives_the_take(seed):
    rng = np.random.default_rng(seed)
    skeleton = random_skeleton(rng, 6, branching=0.0)
    clip = random_clip(rng, skeleton)
    project = scene(rng)[0].with_takes(clip).with_characters(still_shape("line", skeleton))
    project = bind_chain(project, "line", (0,), "take", (0,), basis=EYE)
    project = bind_chain(project, "line", range(6), "take", range(6), basis=EYE, mode="end")
    turns, _ = Player(project, "line").sample(np.arange(9) * clip.step)
    assert angle(turns, clip.turns) < 1e-5


@laws
@given(seeds)
def test_a_small_weight_is_a_small_change(seed):
    rng = np.random.default_rng(seed)
    source, target = line(rng, 4), line(rng, 6)
    clip = random_clip(rng, source)
    project = scene(rng)[0].with_takes(clip).with_characters(still_shape("line", target))
    project = bind_chain(project, "line", range(6), "take", range(4), mode="end", layer_id="end", weight=0.0)
    times = np.arange(9) * clip.step
    still = Player(project, "line").sample(times)[1]
    np.testing.assert_allclose(still, np.tile(target.positions, (9, 1, 1)), atol=1e-12)
    little = Player(set_layer(project, "line", "end", weight=1e-4), "line").sample(times)[1]
    assert np.abs(little - still).max() < 0.02


def test_two_arms_of_one_layer_are_led_apart_and_side_branches_ride():
    rng = np.random.default_rng(4)
    source = line(rng, 4)
    clip = random_clip(rng, source)
    # There are two arms of two bones from joint 1, and a thumb on the first arm's elbow.
    at = np.array(
        [[0, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0.1], [-1, 1, 0], [-2, 1, 0.1], [1, 1.5, 0]], float
    )
    tree = Skeleton(tuple("abcdefg"), np.array([-1, 0, 1, 2, 1, 4, 2], np.int32), at)
    project = scene(rng)[0].with_takes(clip).with_characters(still_shape("tree", tree))
    for chain in ((1, 2, 3), (1, 4, 5)):
        project = bind_chain(
            project, "tree", chain, "take", range(4), basis=EYE, mode="end", layer_id=str(chain)
        )
    turns, joints = Player(project, "tree").sample(np.arange(9) * clip.step)
    way = posed(clip, range(4))[:, -1] / source.lengths.sum()
    for chain in ((1, 2, 3), (1, 4, 5)):
        expected = joints[:, 1] + tree.lengths[list(chain[1:])].sum() * way
        assert np.abs(joints[:, chain[-1]] - expected).max() < 1e-6
    assert angle(turns[:, 6], turns[:, 2]) < 1e-9
    np.testing.assert_allclose(joints[:, 6] - joints[:, 2], rotate(turns[:, 6], tree.vectors[6]), atol=1e-12)


def test_unknown_mode_is_refused():
    project, clip, _ = scene(np.random.default_rng(0))
    with pytest.raises(InputError, match="known modes: turns, end"):
        bind_chain(project, "shape", (0,), clip.id, (0,), mode="fly")


def test_a_chain_that_was_cut_follows_its_own_part():
    # The second half of a chain is mapped alone. Its end is at the take's end position, relative to the
    # take's middle.
    rng = np.random.default_rng(6)
    source, target = line(rng, 7, 0.1), line(rng, 7, 0.1)
    clip = random_clip(rng, source)
    project = scene(rng)[0].with_takes(clip).with_characters(still_shape("line", target))
    project = bind_chain(project, "line", range(7), "take", range(7), basis=EYE, mode="end")
    whole = project.shape("line")
    half = Skeleton(target.names[3:], target.parents[3:] - 3, target.positions[3:])
    part = still_shape("half", half).with_changes(
        spans=(whole.spans[0], *whole.spans[4:]), layers=whole.layers
    )
    start = part.spans[1][0].refs[0].start
    assert 0.2 < start < 0.8
    joints = Player(project.with_characters(part), "half").sample(np.arange(9) * clip.step)[1]
    at, arc = (
        posed(clip, range(7)),
        np.concatenate([[0.0], source.lengths[1:].cumsum()]) / source.lengths.sum(),
    )
    k = int(np.searchsorted(arc, start)) - 1
    share = (start - arc[k]) / (arc[k + 1] - arc[k])
    begin = at[:, k] + share * (at[:, k + 1] - at[:, k])
    turn = sample_rotations(Polyline.from_clip(clip, range(7)), [start], np.arange(9))[:, 0]
    scale = half.lengths.sum() / ((1 - start) * source.lengths.sum())
    expected = joints[:, 0] + scale * rotate(conjugate(turn), at[:, -1] - begin)
    np.testing.assert_allclose(joints[:, -1], expected, atol=1e-5)
