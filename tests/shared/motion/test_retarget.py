"""Tests of binding chains: the retargeted motion does not depend on sampling, rotation or names of either
side.
"""

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

from enliven.document.clip import Clip
from enliven.document.layers import Ref, Span
from enliven.document.project import Project
from enliven.document.rigged import RiggedCharacter, still_shape
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.modeling.rigged.spans import join_consecutive_spans, split_spans
from enliven.motion.layers.copying import copy_motion
from enliven.motion.layers.evaluate import Player
from enliven.motion.layers.retarget import bind_chain, chain_between, clear_chain, extend_to_leaf, set_travel
from enliven.rotation import canonical, conjugate, from_rotation_vector, multiply, rotate, to_rotation_vector

laws = settings(deadline=None, max_examples=30)


def polyline(rng, joints, id="line"):
    """Returns a shape at rest that is a single polyline."""
    return still_shape(id, random_skeleton(rng, joints, branching=0.0))


def with_node(shape: RiggedCharacter, bone: int, at: float) -> RiggedCharacter:
    """Returns the shape with a node inserted into a bone, and a map of the joint numbers."""
    old = shape.skeleton
    place = old.positions[old.parents[bone]] + at * old.vectors[bone]
    names = (*old.names[:bone], f"node {len(old)}", *old.names[bone:])
    parents = [p + (p >= bone) for p in np.delete(old.parents, bone).tolist()]
    parents = [*parents[:bone], int(old.parents[bone]), bone, *parents[bone:]]
    positions = np.insert(old.positions, bone, place, axis=0)
    upper, lower = split_spans(shape.spans[bone], at)
    spans = (*shape.spans[:bone], upper, lower, *shape.spans[bone + 1 :])
    modeling = np.insert(shape.modeling, bone + 1, EYE, axis=0)
    skeleton = Skeleton(names, np.array(parents, np.int32), positions)
    return shape.with_changes(skeleton=skeleton, modeling=modeling, spans=spans)


@laws
@given(seeds, st.lists(st.tuples(st.integers(0, 99), st.floats(0.05, 0.95)), min_size=1, max_size=6))
def test_inserting_nodes_keeps_the_total_turn_and_resampling_commutes(seed, nodes):
    rng = np.random.default_rng(seed)
    project, clip, _ = scene(rng)
    source = chain_to(clip.skeleton, 7)
    target = polyline(rng, 5)
    project = bind_chain(project.with_characters(target), "line", range(5), "take", source)
    times = times_of(clip)
    before, _ = Player(project, "line").sample(times)
    finer, plain = project.shape("line"), target
    for bone, at in nodes:
        number = 1 + bone % (len(finer.skeleton) - 1)
        finer, plain = with_node(finer, number, at), with_node(plain, number, at)
    edited, _ = Player(project.with_characters(finer), "line").sample(times)
    # The old joints' bones are turned as before at their ends: the total along the polyline is the same.
    old = [finer.skeleton.names.index(name) for name in target.skeleton.names]
    assert angle(edited[:, old], before) < 1e-9
    # Retargeting onto the finer polyline gives what the edit made of the coarse one.
    again = bind_chain(
        project.with_characters(plain), "line", range(len(plain.skeleton)), "take", source, layer_id="new"
    )
    assert angle(Player(again, "line").sample(times)[0], edited) < 1e-9


@laws
@given(seeds, st.floats(0.05, 0.95))
def test_taking_the_node_out_restores_the_motion(seed, at):
    rng = np.random.default_rng(seed)
    project, clip, _ = scene(rng)
    shape = polyline(rng, 4)
    project = bind_chain(project.with_characters(shape), "line", range(4), "take", chain_to(clip.skeleton, 7))
    shape = project.shape("line")
    upper, lower = split_spans(shape.spans[2], at)
    spans = list(shape.spans)
    spans[2] = join_consecutive_spans(upper, lower, at)
    times = times_of(clip)
    restored = Player(project.with_characters(shape.with_changes(spans=tuple(spans))), "line").sample(times)
    assert angle(restored[0], Player(project, "line").sample(times)[0]) < 1e-9


@laws
@given(seeds)
def test_the_identical_polyline_moves_as_the_source(seed):
    rng = np.random.default_rng(seed)
    skeleton = random_skeleton(rng, 6, branching=0.0)
    clip = random_clip(rng, skeleton)
    project = scene(rng)[0].with_takes(clip).with_characters(still_shape("line", skeleton))
    # In any view, with the basis that the view gives: the same polyline has the same one.
    how = {"view": rng.normal(size=3), "up": rng.normal(size=3)}
    project = bind_chain(project, "line", range(6), "take", range(6), **how)
    project = bind_chain(project, "line", (0,), "take", (0,), basis=EYE)
    turns, joints = Player(project, "line").sample(np.arange(9) * clip.step)
    assert angle(turns, clip.turns) < 1e-9
    at = np.tile(skeleton.positions[0], (9, 1))
    for j in range(1, 6):
        at = at + rotate(clip.turns[:, j], skeleton.vectors[j])
        np.testing.assert_allclose(joints[:, j], at, atol=1e-9)


@laws
@given(seeds)
def test_two_skeletons_turned_with_their_views_move_alike(seed):
    rng = np.random.default_rng(seed)
    project, clip, _ = scene(rng)
    shape, by = polyline(rng, 5), random_turn(rng)
    source, view, up = chain_to(clip.skeleton, 7), rng.normal(size=3), rng.normal(size=3)
    plain = bind_chain(project.with_characters(shape), "line", range(5), "take", source, view=view, up=up)

    def turned(skeleton):
        return Skeleton(skeleton.names, skeleton.parents, rotate(by, skeleton.positions))

    turns = multiply(multiply(by, clip.turns), conjugate(by))
    other = type(clip)("take", turned(clip.skeleton), turns, rotate(by, clip.root), clip.step)
    moved = project.with_takes(other).with_characters(still_shape("line", turned(shape.skeleton)))
    how = {"view": rotate(by, view), "up": rotate(by, up)}
    moved = bind_chain(moved, "line", range(5), "take", source, **how)
    times = times_of(clip)
    (a, x), (b, y) = Player(plain, "line").sample(times), Player(moved, "line").sample(times)
    assert angle(multiply(multiply(by, a), conjugate(by)), b) < 1e-7
    np.testing.assert_allclose(rotate(by, x), y, atol=1e-7)


@laws
@given(seeds, st.floats(0.1, 9))
def test_the_size_of_either_does_not_matter(seed, scale):
    rng = np.random.default_rng(seed)
    project, clip, _ = scene(rng)
    shape = polyline(rng, 4)
    old = shape.skeleton
    big = still_shape("big", Skeleton(old.names, old.parents, old.positions * scale))
    project = project.with_characters(shape, big)
    for name in ("line", "big"):
        project = bind_chain(project, name, range(4), "take", chain_to(clip.skeleton, 7))
    times = times_of(clip)
    assert angle(Player(project, "line").sample(times)[0], Player(project, "big").sample(times)[0]) < 1e-9


@laws
@given(seeds)
def test_another_layer_lies_on_the_spans_that_are_there(seed):
    # On a bone of many spans the new layer gives the same whole as on a bone of one.
    rng = np.random.default_rng(seed)
    project, clip, _ = scene(rng)
    shape = polyline(rng, 4)
    cut = list(shape.spans)
    cut[2] = (Span(0.2), Span(0.5), Span(0.3))
    project = project.with_characters(shape, shape.with_changes(id="cut", spans=tuple(cut)))
    for name in ("line", "cut"):
        project = bind_chain(project, name, range(4), "take", chain_to(clip.skeleton, 7))
    times = times_of(clip)
    assert (
        angle(
            Player(project, "line").animation_rotations(times),
            Player(project, "cut").animation_rotations(times),
        )
        < 1e-9
    )
    refs = [span.refs[0] for span in project.shape("cut").spans[2]]
    whole = project.shape("line").spans[2][0].refs[0]
    assert refs[0].start == whole.start and refs[-1].end == whole.end
    assert refs[0].end == refs[1].start and refs[1].end == refs[2].start


def test_clearing_a_chain_leaves_the_rest_alone():
    rng = np.random.default_rng(2)
    project, clip, _ = scene(rng)
    source = chain_to(clip.skeleton, 7)
    project = project.with_characters(polyline(rng, 6))
    bare = project.shape("line").spans
    bound = bind_chain(project, "line", range(6), "take", source, layer_id="a")
    two = bind_chain(bound, "line", (2, 3, 4), "take", source, layer_id="b")
    less = clear_chain(two, "line", (2, 3, 4), "b")
    assert less.shape("line").spans == bound.shape("line").spans and set(less.layer_names) == {"a"}
    half = clear_chain(two, "line", (3, 4, 5))
    assert [bool(s[0].refs) for s in half.shape("line").spans] == [False, True, True, True, False, False]
    assert set(half.layer_names) == {"a", "b"} and set(half.takes) == {"take"}
    none = clear_chain(two, "line", range(6))
    assert none.shape("line").spans == bare and not none.layer_names
    # A layer that moves the root stays.
    cleared = clear_chain(set_travel(bound, "line", "a"), "line", range(6))
    assert set(cleared.layer_names) == {"a"}


@laws
@given(seeds, st.integers(3, 7), st.integers(2, 8))
def test_a_copy_of_motion_keeps_the_total_turn_and_every_layer(seed, first, second):
    rng = np.random.default_rng(seed)
    project, clip, _ = scene(rng)
    project = project.with_characters(polyline(rng, first, "one"), polyline(rng, second, "other"))
    source = chain_to(clip.skeleton, 7)
    project = bind_chain(project, "one", range(first), "take", source, layer_id="a", basis=random_turn(rng))
    project = bind_chain(project, "one", (1, 2), "take", source, layer_id="b", basis=random_turn(rng))
    basis = random_turn(rng)
    copied = copy_motion(project, "one", range(first), "other", range(second), basis=basis)
    assert len(copied.layer_names) == 4 and copied.shape("other").layer("a 2").take == "take"
    times = times_of(clip)
    one_turns, other_turns = (Player(copied, name).sample(times)[0] for name in ("one", "other"))
    assert angle(multiply(multiply(basis, one_turns[:, -1]), conjugate(basis)), other_turns[:, -1]) < 1e-9
    # Retargeting a take onto itself, in place of the existing layer, changes nothing.
    replaced = copy_motion(project, "one", range(first), "one", range(first), basis=EYE, replaced=True)
    assert angle(Player(replaced, "one").sample(times)[0], one_turns) < 1e-9


@laws
@given(seeds, st.floats(-1, 1))
def test_a_delayed_copy_is_the_same_later(seed, delay):
    rng = np.random.default_rng(seed)
    project, clip, _ = scene(rng)
    project = project.with_characters(polyline(rng, 5, "one"))
    project = bind_chain(project, "one", range(5), "take", chain_to(clip.skeleton, 7))
    twin = project.shape("one").with_changes(id="twin", spans=polyline(rng, 5).spans)
    project = copy_motion(project.with_characters(twin), "one", range(5), "twin", range(5), delay=delay)
    times = times_of(clip)
    first, second = Player(project, "one").sample(times)[0], Player(project, "twin").sample(times + delay)[0]
    assert angle(first, second) < 1e-6


def test_the_longest_way_down():
    at = np.array([[0, 0, 0], [0, 1, 0], [0, 1.5, 0], [1, 1, 0], [3, 1, 0], [0, -5, 0]], float)
    tree = Skeleton(tuple("abcdef"), np.array([-1, 0, 1, 1, 3, 0], np.int32), at)
    assert extend_to_leaf(tree, 1) == (1, 3, 4)
    assert extend_to_leaf(tree, 0) == (0, 5)
    assert extend_to_leaf(tree, 4) == (4,)
    assert chain_between(tree, 0, 1) == (0, 1, 3, 4)
    assert chain_between(tree, 0, 1, extend=False) == (0, 1)


def test_an_edit_that_cannot_be_changes_nothing():
    rng = np.random.default_rng(2)
    project, clip, _ = scene(rng)
    tree = still_shape(
        "tree", Skeleton(tuple("abcd"), np.array([-1, 0, 1, 0], np.int32), rng.normal(size=(4, 3)))
    )
    project = project.with_characters(tree)
    chain = chain_to(clip.skeleton, 7)
    bad = [
        (lambda: bind_chain(project, "ghost", (0, 1), "take", chain), "no shape"),
        (lambda: bind_chain(project, "tree", (0, 1), "ghost", chain), "take 'ghost' does not exist"),
        (lambda: bind_chain(project, "tree", (0, 2), "take", chain), "not neighbours"),
        (lambda: bind_chain(project, "tree", (0, 1), "take", (0, 99)), "joint 99 does not exist"),
        (lambda: bind_chain(project, "tree", (2, 1, 0), "take", chain), "from 'a' to 'c'"),
        (lambda: bind_chain(project, "tree", (2, 1, 0, 3), "take", chain), "two chains"),
        (lambda: bind_chain(project, "tree", (0, 1), "take", chain, weight=2.0), "weight"),
        (lambda: set_layer(project, "tree", "ghost", muted=True), "no layer 'ghost'"),
        (lambda: set_travel(project, "tree", "ghost"), "no layer 'ghost'"),
    ]
    for edit, words in bad:
        with pytest.raises(InputError, match=words):
            edit()
    bound = bind_chain(project, "tree", (0, 1), "take", chain, layer_id="once")
    with pytest.raises(InputError, match="already"):
        bind_chain(bound, "tree", (0, 1), "take", chain, layer_id="once")
    assert not project.layer_names and bound.shape("tree").spans[1] == (Span(1.0, (Ref("once", 0.0, 1.0),)),)


def test_a_bend_is_seen_the_same_in_the_view():
    # If an arm to the right bends up, a leg to the left bends up as well. With the flip, it bends down.
    arm = Skeleton(
        ("a", "b", "c"), np.array([-1, 0, 1], np.int32), np.array([[0, 0, 0], [1, 0, 0], [2.0, 0, 0]])
    )
    bend = from_rotation_vector([[0, 0, 0], [0, 0, 0], [0, 0, 0.6]])
    clip = random_clip(np.random.default_rng(0), arm, 1)
    clip = type(clip)("take", arm, np.stack([np.tile(EYE, (3, 1)), bend]), np.zeros((2, 3)), 0.1)
    leg = Skeleton(arm.names, arm.parents, arm.positions * [-0.5, 0, 0])
    project = scene(np.random.default_rng(0))[0].with_takes(clip).with_characters(still_shape("leg", leg))
    plain = bind_chain(project, "leg", range(3), "take", range(3))
    flipped = bind_chain(project, "leg", range(3), "take", range(3), flip=True)
    assert Player(plain, "leg").compute_pose(0.1).joints[2, 1] == pytest.approx(0.5 * np.sin(0.6))
    assert Player(flipped, "leg").compute_pose(0.1).joints[2, 1] == pytest.approx(-0.5 * np.sin(0.6))
    mirrored = bind_chain(project, "leg", range(3), "take", range(3), mirrored=True, basis=EYE)
    seen = bind_chain(project, "leg", range(3), "take", range(3), mirrored=True)
    assert Player(mirrored, "leg").compute_pose(0.1).joints[2, 1] == pytest.approx(0.5 * np.sin(0.6))
    assert angle(canonical(seen.shape("leg").layer("take").basis), EYE) < 1e-9


def test_turns_are_spread_along_the_target_as_in_the_papers_figure_4():
    # Two bones that bend by 30 and 40 degrees are mapped to four bones of half their length: 15, 15, 20 and
    # 20.
    def line(joints):
        at = np.stack([np.linspace(0, 1, joints), np.zeros(joints), np.zeros(joints)], 1)
        names = tuple(f"j{i}" for i in range(joints))
        return Skeleton(names, np.arange(-1, joints - 1, dtype=np.int32), at)

    turns = from_rotation_vector(np.radians([[0, 0, 0], [0, 0, 30], [0, 0, 70]]))
    clip = Clip("take", line(3), turns[None], np.zeros((1, 3)), 0.1)
    project = Project().with_takes(clip).with_characters(still_shape("line", line(5)))
    project = bind_chain(project, "line", range(5), "take", range(3))
    own = np.degrees(to_rotation_vector(Player(project, "line").animation_rotations([0.0])[0]))
    np.testing.assert_allclose(own[:, 2], [0, 15, 15, 20, 20], atol=1e-9)
    assert not own[:, :2].any()
    # At half the weight, each bone has half the rotation. If only half of the target is bound, it has
    # the whole rotation.
    half = Player(set_layer(project, "line", "take", weight=0.5), "line").animation_rotations([0.0])[0]
    np.testing.assert_allclose(np.degrees(to_rotation_vector(half))[:, 2], [0, 7.5, 7.5, 10, 10], atol=1e-9)
    short = bind_chain(clear_chain(project, "line", range(5)), "line", (2, 3, 4), "take", range(3))
    own = np.degrees(to_rotation_vector(Player(short, "line").animation_rotations([0.0])[0]))
    np.testing.assert_allclose(own[:, 2], [0, 0, 0, 30, 40], atol=1e-9)


@laws
@given(seeds, st.sampled_from(["turns", "end"]))
def test_a_mirrored_layer_is_a_layer_of_the_mirrored_take(seed, mode):
    rng = np.random.default_rng(seed)
    project, clip, _ = scene(rng)
    shape, source = polyline(rng, 5), chain_to(clip.skeleton, 7)
    old, view = clip.skeleton, rng.normal(size=3)
    mirrored_skeleton = Skeleton(old.names, old.parents, old.positions * [-1, 1, 1])
    glass = Clip("glass", mirrored_skeleton, clip.turns * [1, 1, -1, -1], clip.root * [-1, 1, 1], clip.step)
    project = project.with_takes(glass).with_characters(shape)
    how = {"mode": mode, "layer_id": "layer", "view": view}
    mirrored = bind_chain(project, "line", range(5), "take", source, mirrored=True, **how)
    other = bind_chain(project, "line", range(5), "glass", source, **how)
    times = times_of(clip)
    (a, x), (b, y) = (Player(set_travel(p, "line", "layer"), "line").sample(times) for p in (mirrored, other))
    np.testing.assert_allclose(x, y, atol=1e-7)
    assert angle(a, b) < 1e-6
