"""Tests of a shape's pose at a time: against the definition in plain steps, and properties of layers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from layer_edits import set_layer
from motion_strategies import (
    EYE,
    angle,
    chain_to,
    random_clip,
    random_skeleton,
    random_turn,
    scene,
    seeds,
    times_of,
)
from polylines import sample_rotations
from tolerances import are_alike

from enliven.document.layers import Layer, Ref, Span
from enliven.document.project import Project
from enliven.document.rigged import RiggedCharacter, still_shape
from enliven.errors import InputError
from enliven.motion.layers.evaluate import Player, evaluate_pose
from enliven.motion.layers.polyline import Polyline
from enliven.motion.layers.retarget import bind_chain, set_travel
from enliven.motion.layers.timing import LayerClocks
from enliven.motion.layers.travel import travel_scale
from enliven.rotation import conjugate, multiply, rotate, to_matrix

laws = settings(deadline=None, max_examples=30)


def plain_pose(project, shape, seconds):
    """Computes the definition D_j = D_parent m_j a_j, span by span and layer by layer."""

    def q(ref, s):
        layer = shape.layer(ref.layer)
        if layer.muted:
            return EYE
        clip = project.takes[layer.take]
        frames = LayerClocks.from_layers([layer], [clip]).frames_at(np.array([seconds]))[0][:, 0]
        line = Polyline.from_clip(clip, layer.chain)
        return sample_rotations(line, [s], frames, layer.weight, layer.basis, layer.mirrored)[0, 0]

    skeleton = shape.skeleton
    turns, joints = np.empty((len(skeleton), 4)), np.empty((len(skeleton), 3))
    for j, parent in enumerate(skeleton.parents):
        own = EYE
        for span in shape.spans[j]:
            first, last = EYE, EYE
            for ref in span.refs:
                first, last = multiply(first, q(ref, ref.start)), multiply(last, q(ref, ref.end))
            own = multiply(multiply(own, span.before), multiply(conjugate(first), last))
        turns[j] = multiply(shape.modeling[j], own)
        if parent < 0:
            joints[j] = skeleton.positions[0] + shape.place
            continue
        turns[j] = multiply(turns[parent], turns[j])
        joints[j] = joints[parent] + rotate(turns[j], skeleton.vectors[j])
    return turns, joints


def any_spans(rng, names):
    """Returns up to three spans with random shares, references and fixed rotations."""
    shares = rng.dirichlet(np.ones(rng.integers(1, 4)))
    spans = []
    for share in shares / shares.sum():
        refs = tuple(Ref(str(n), *rng.uniform(size=2)) for n in rng.choice(names, rng.integers(0, 3)))
        spans.append(
            Span(float(share), refs, tuple(random_turn(rng)) if rng.random() < 0.3 else (1.0, 0, 0, 0))
        )
    return tuple(spans)


def any_project(rng):
    """Returns two takes, four layers with random parameters, and a shape with random spans of them on every
    bone."""
    clips = [random_clip(rng, random_skeleton(rng, 6), 7, name) for name in ("one", "two")]
    layers = []
    for i in range(4):
        clip = clips[i % 2]
        chain = clip.skeleton.path(*rng.integers(0, 6, 2).tolist())
        layers.append(
            Layer(
                f"layer {i}",
                clip.id,
                chain,
                random_turn(rng),
                offset=float(rng.normal() * 0.1),
                speed=float(rng.choice([-1.0, 0.5, 1.0, 2.0])),
                loop=bool(rng.random() < 0.5),
                weight=float(rng.choice([0.0, 0.4, 1.0])),
                muted=bool(rng.random() < 0.2),
                mirrored=bool(rng.random() < 0.3),
            )
        )
    skeleton = random_skeleton(rng, 9)
    modeling = np.array([random_turn(rng) for _ in range(9)])
    spans = tuple(any_spans(rng, [layer.id for layer in layers]) for _ in range(9))
    shape = RiggedCharacter("shape", skeleton, modeling, spans, rng.normal(size=3), layers=tuple(layers))
    return Project().with_takes(*clips).with_characters(shape), shape


@pytest.mark.slow
@laws
@given(seeds)
def test_the_kernels_are_the_definition(seed):
    project, shape = any_project(np.random.default_rng(seed))
    times = np.array([-0.3, 0.0, 0.05, 0.12, 0.2, 0.9])
    turns, joints = Player(project, "shape").sample(times)
    for i, seconds in enumerate(times):
        their_turns, their_joints = plain_pose(project, shape, seconds)
        assert angle(turns[i], their_turns) < 1e-9
        np.testing.assert_allclose(joints[i], their_joints, atol=1e-9)
        at = evaluate_pose(project, "shape", seconds)
        assert angle(at.turns, turns[i]) < 1e-12 and (at.turns[:, 0] >= 0).all()


@laws
@given(seeds)
def test_a_take_on_its_own_skeleton_is_the_take(seed):
    # The root's turn, and the polyline to each joint that has no other below it: every bone once.
    rng = np.random.default_rng(seed)
    project, clip, _shape = scene(rng)
    project = bind_chain(project, "shape", (0,), "take", (0,), basis=EYE)
    free = set(range(1, 8))
    for joint in range(7, 0, -1):
        if joint not in free:
            continue
        chain = chain_to(clip.skeleton, joint)
        first = next(i for i in range(1, len(chain)) if chain[i] in free)
        project = bind_chain(project, "shape", chain[first - 1 :], "take", chain[first - 1 :], basis=EYE)
        free -= set(chain)
    project = set_travel(project, "shape", "take")
    turns, joints = Player(project, "shape").sample(np.arange(9) * clip.step)
    assert angle(turns, clip.turns) < 1e-9
    expected = np.empty_like(joints)
    expected[:, 0] = clip.root
    for j in range(1, 8):
        parent = clip.skeleton.parents[j]
        expected[:, j] = expected[:, parent] + rotate(clip.turns[:, j], clip.skeleton.vectors[j])
    np.testing.assert_allclose(joints, expected, atol=1e-9)


@laws
@given(seeds, st.sampled_from(["muted", "weight", "removed"]))
def test_mute_and_weight_0_are_removal(seed, how):
    rng = np.random.default_rng(seed)
    project, clip, _ = scene(rng)
    below = chain_to(clip.skeleton, 7)
    once = bind_chain(project, "shape", below, "take", below)
    twice = bind_chain(once, "shape", below, "take", below, basis=random_turn(rng), layer_id="more")
    less = {
        "muted": lambda: set_layer(twice, "shape", "more", muted=True),
        "weight": lambda: set_layer(twice, "shape", "more", weight=0.0),
        "removed": lambda: once,
    }[how]()
    times = times_of(clip)
    for ours, theirs in zip(
        Player(less, "shape").sample(times), Player(once, "shape").sample(times), strict=True
    ):
        assert are_alike(ours, theirs)
    still = set_layer(set_layer(twice, "shape", "take", weight=0.0), "shape", "more", muted=True)
    turns, joints = Player(still, "shape").sample(times)
    assert are_alike(turns, np.broadcast_to(EYE, turns.shape))
    np.testing.assert_allclose(joints, np.broadcast_to(clip.skeleton.positions, joints.shape), atol=1e-12)


@laws
@given(seeds, st.floats(0.05, 0.95))
def test_a_part_weight_is_on_the_way_from_rest_to_the_whole(seed, weight):
    rng = np.random.default_rng(seed)
    skeleton = random_skeleton(rng, 2)
    clip = random_clip(rng, skeleton)
    project = Project().with_takes(clip).with_characters(still_shape("shape", skeleton))
    project = bind_chain(project, "shape", (0, 1), "take", (0, 1), basis=EYE)
    times = np.arange(9) * clip.step
    whole = Player(project, "shape").animation_rotations(times)[:, 1]
    part = Player(set_layer(project, "shape", "take", weight=weight), "shape").animation_rotations(times)[
        :, 1
    ]
    for a, b in zip(part, whole, strict=True):
        assert angle(a, EYE) == pytest.approx(weight * angle(b, EYE), abs=1e-7)


@laws
@given(seeds, st.floats(-2, 2), st.sampled_from([-2.0, -1.0, 0.5, 3.0]), st.booleans())
def test_offset_and_speed_move_the_take_in_time(seed, offset, speed, loop):
    rng = np.random.default_rng(seed)
    project, clip, _ = scene(rng)
    chain = chain_to(clip.skeleton, 7)
    plain = bind_chain(project, "shape", chain, "take", chain)
    played = set_layer(plain, "shape", "take", offset=offset, speed=speed, loop=loop)
    into = np.array([0.02, 0.3, 0.61, 0.99]) * clip.duration
    start = 0.0 if speed > 0 else clip.duration
    times = offset + (into - start) / speed
    a, b = Player(played, "shape"), Player(plain, "shape")
    assert angle(a.sample(times)[0], b.sample(into)[0]) < 1e-6
    if loop:
        assert angle(a.sample(times + 3 * clip.duration / abs(speed))[0], b.sample(into)[0]) < 1e-6


@laws
@given(seeds)
def test_layers_on_one_another_telescope(seed):
    # Whatever lies on a chain, the turn from its one end to the other is C(1), the product of the layers'.
    rng = np.random.default_rng(seed)
    project, clip, _ = scene(rng)
    chain, times = chain_to(clip.skeleton, 7), times_of(clip)
    if len(chain) < 2:
        return
    expected = np.tile(EYE, (len(times), 1))
    for i in range(3):
        basis = random_turn(rng)
        project = bind_chain(
            project, "shape", chain, "take", chain, basis=basis, layer_id=str(i), offset=0.1 * i
        )
        layer = project.shape("shape").layer(str(i))
        frames = LayerClocks.from_layers([layer], [clip]).frames_at(np.asarray(times, float))[0][:, 0]
        q = sample_rotations(Polyline.from_clip(clip, chain), [1.0], frames, 1.0, basis)[:, 0]
        expected = multiply(expected, q)
    turns, _ = Player(project, "shape").sample(times)
    assert angle(multiply(conjugate(turns[:, chain[0]]), turns[:, 7]), expected) < 1e-9


def test_travel_goes_as_far_as_the_legs_are_long():
    rng = np.random.default_rng(3)
    project, clip, shape = scene(rng)
    small = still_shape(
        "small",
        type(shape.skeleton)(shape.skeleton.names, shape.skeleton.parents, shape.skeleton.positions * 0.25),
    )
    project = bind_chain(project.with_characters(small), "small", (0,), "take", (0,), basis=EYE)
    project = set_travel(project, "small", "take")
    assert project.shape("small").travel_scale == pytest.approx(0.25)
    times = np.arange(9) * clip.step
    way = Player(project, "small").sample(times)[1][:, 0] - small.skeleton.positions[0]
    np.testing.assert_allclose(way, 0.25 * (clip.root - clip.skeleton.positions[0]), atol=1e-12)
    # The layer is rotated, halved and mirrored. Without it or without travel, the root stands still.
    half = set_layer(project, "small", "take", weight=0.5, basis=[0.5, 0.5, 0.5, 0.5], mirrored=True)
    turned = Player(half, "small").sample(times)[1][:, 0] - small.skeleton.positions[0]
    np.testing.assert_allclose(turned, 0.5 * rotate([0.5, 0.5, 0.5, 0.5], way * [-1, 1, 1]), atol=1e-12)
    for still in (set_travel(project, "small", None), set_layer(project, "small", "take", muted=True)):
        assert are_alike(
            Player(still, "small").compute_root(times), np.tile(small.skeleton.positions[0], (9, 1))
        )


def test_without_legs_the_whole_extent_is_the_size():
    rng = np.random.default_rng(0)
    walker, snake = random_skeleton(rng, 6), random_skeleton(rng, 6)
    flat = type(snake)(snake.names, snake.parents, snake.positions * [1.0, 0.0, 1.0])
    clip = random_clip(rng, walker)
    scale = travel_scale(still_shape("snake", flat), clip)
    for s in (flat, walker):
        wide = max(np.hypot(*(a - b)[[0, 2]]) for a in s.positions for b in s.positions)
        scale *= np.hypot(wide, np.ptp(s.positions[:, 1])) ** (-1 if s is flat else 1)
    assert scale == pytest.approx(1.0)
    c, s = np.cos(0.7), np.sin(0.7)
    aside = type(snake)(snake.names, snake.parents, flat.positions @ [[c, 0, -s], [0, 1, 0], [s, 0, c]])
    both = [travel_scale(still_shape("snake", each), clip) for each in (flat, aside)]
    assert both[1] == pytest.approx(both[0]), "however it is turned"


def test_the_pose_moves_vertices_as_the_bones_go():
    rng = np.random.default_rng(5)
    project, shape = any_project(rng)
    at, pose = evaluate_pose(project, "shape", 0.1), Player(project, "shape").compute_message_pose(0.1)
    skeleton = shape.skeleton
    assert pose.character == "shape" and pose.time_ns == 100_000_000
    np.testing.assert_allclose(pose.linear, to_matrix(at.turns), atol=1e-6)
    above = np.maximum(skeleton.parents, 0)
    for j in range(9):
        # A point skinned to bone j at the joint's rest position follows the joint.
        v = pose.linear[j] @ (skeleton.positions[j] - skeleton.positions[above[j]]) + pose.positions[j]
        np.testing.assert_allclose(v, at.joints[j], atol=1e-5)


@laws
@given(seeds)
def test_a_live_moment_is_played_as_the_same_frame_of_a_take(seed):
    rng = np.random.default_rng(seed)
    project, clip, _ = scene(rng)
    chain = chain_to(clip.skeleton, 7)
    project = set_travel(bind_chain(project, "shape", chain, "take", chain), "shape", "take")
    player, kept = Player(project, "shape"), Player(project, "shape")
    for frame in (3, 7):
        player.feed("take", clip.turns[frame], clip.root[frame])
        assert angle(player.compute_pose(99.0).turns, kept.compute_pose(frame * clip.step).turns) < 1e-9
        np.testing.assert_allclose(
            player.compute_pose(0.0).joints, kept.compute_pose(frame * clip.step).joints, atol=1e-9
        )
    with pytest.raises(InputError, match="does not match rotations"):
        player.feed("take", clip.turns[0][:3], clip.root[0])
    with pytest.raises(InputError, match="does not match rotations"):
        player.feed("nobody", clip.turns[0], clip.root[0])


def test_missing_shape_is_refused():
    with pytest.raises(InputError, match="no shape"):
        evaluate_pose(Project(), "ghost", 0.0)


@pytest.mark.parametrize("speed", [1.0, -1.0, 2.0])
def test_looped_take_continues_from_its_end(speed):
    rng = np.random.default_rng(8)
    project, clip, _ = scene(rng)
    project = bind_chain(project, "shape", (0,), "take", (0,), basis=random_turn(rng), speed=speed, loop=True)
    player = Player(set_travel(project, "shape", "take"), "shape")
    layer = project.shape("shape").layer("take")
    way = rotate(layer.basis, (clip.root[-1] - clip.root[0]) * [1, 0, 1]) * np.sign(speed)
    times, period = np.array([0.011, 0.1]), clip.duration / abs(speed)
    for rounds in (-2, 1, 5):
        later = player.compute_root(times + rounds * period)
        np.testing.assert_allclose(later, player.compute_root(times) + rounds * way, atol=1e-9)
    # The floor position has no jump where the loop restarts.
    seam = rotate(
        conjugate(layer.basis), np.diff(player.compute_root(period + np.array([-1e-9, 1e-9])), axis=0)[0]
    )
    assert np.abs(seam[[0, 2]]).max() < 1e-6
