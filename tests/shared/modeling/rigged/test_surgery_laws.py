"""Tests of what adding nodes, cuts and merges preserve, on random skeletons, takes and times."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surgery_worlds import angle, random_project, slow_pose

from enliven.errors import InputError
from enliven.modeling.rigged.cutting import cut_bone
from enliven.modeling.rigged.merging import merge
from enliven.modeling.rigged.nodes import insert_node, remove_node
from enliven.modeling.rigged.posed import compute_pose
from enliven.motion.layers.evaluate import evaluate_pose
from enliven.rotation import conjugate, multiply, rotate

SEEDS = st.integers(0, 2**32 - 1)
TIMES = st.floats(-1.0, 3.0)
MOMENTS = st.one_of(st.none(), TIMES)
PLACES = st.floats(0.02, 0.98)
laws = settings(deadline=None, max_examples=25)


def at(project, shape_id, time):
    """Returns world rotations and joint positions by name, at rest if ``time`` is None."""
    turns, joints = compute_pose(project, project.shape(shape_id), time)
    names = project.shape(shape_id).skeleton.names
    return dict(zip(names, turns, strict=True)), dict(zip(names, joints, strict=True))


def assert_same_turns(before, after, names=None):
    for name in before if names is None else names:
        assert angle(before[name], after[name]) < 1e-9, name


def assert_same_places(before, after, names=None):
    for name in before if names is None else names:
        np.testing.assert_allclose(before[name], after[name], atol=1e-9, err_msg=name)


def a_bone(project, random, shape_id="shape 0"):
    return int(random.integers(1, len(project.shape(shape_id).skeleton)))


@laws
@given(SEEDS, TIMES)
def test_the_evaluation_is_the_slow_one(seed, time):
    project, _ = random_project(seed, 1)
    shape = project.shape("shape 0").with_changes(travel=None)
    project = project.with_characters(shape)
    turns, joints = slow_pose(project, "shape 0", time)
    fast = evaluate_pose(project, "shape 0", time)
    assert angle(turns, fast.turns) < 1e-9
    np.testing.assert_allclose(fast.joints, joints, atol=1e-9)


@laws
@given(SEEDS, TIMES, PLACES)
def test_a_node_keeps_the_turn_of_every_bone_at_every_time(seed, time, place):
    project, random = random_project(seed, 1)
    edited, name = insert_node(project, "shape 0", a_bone(project, random), place)
    before, after = at(project, "shape 0", time)[0], at(edited, "shape 0", time)[0]
    assert set(after) == set(before) | {name}
    assert_same_turns(before, after)


@laws
@given(SEEDS, TIMES, st.lists(PLACES, min_size=1, max_size=4))
def test_nodes_taken_out_again_restore_the_shape(seed, time, places):
    project, random = random_project(seed, 1)
    edited, names = project, []
    for place in places:
        edited, name = insert_node(edited, "shape 0", a_bone(edited, random), place)
        names.append(name)
    for name in random.permutation(names):
        edited = remove_node(edited, "shape 0", str(name))
    old, new = project.shape("shape 0"), edited.shape("shape 0")
    assert new.skeleton.names == old.skeleton.names
    np.testing.assert_allclose(new.modeling, old.modeling, atol=1e-9)
    for spans, others in zip(old.spans, new.spans, strict=True):
        assert len(spans) == len(others)
        for span, other in zip(spans, others, strict=True):
            np.testing.assert_allclose(span.before, other.before, atol=1e-9)
            assert abs(span.share - other.share) < 1e-9
            for a, b in zip(span.refs, other.refs, strict=True):
                assert a.layer == b.layer
                assert abs(a.start - b.start) + abs(a.end - b.end) < 1e-9
    assert_same_turns(at(project, "shape 0", time)[0], at(edited, "shape 0", time)[0])
    assert_same_places(at(project, "shape 0", time)[1], at(edited, "shape 0", time)[1])


@laws
@given(SEEDS, TIMES)
def test_any_node_taken_out_leaves_every_other_bone_its_turn(seed, time):
    project, random = random_project(seed, 1)
    shape = project.shape("shape 0")
    gone = shape.skeleton.names[a_bone(project, random)]
    edited = remove_node(project, "shape 0", gone)
    before, after = at(project, "shape 0", time)[0], at(edited, "shape 0", time)[0]
    assert set(after) == set(before) - {gone}
    assert_same_turns(before, after, after)


@laws
@given(SEEDS, MOMENTS, st.one_of(PLACES, st.sampled_from([0.0, 1.0])))
def test_a_cut_moves_nothing_at_its_time(seed, time, place):
    project, random = random_project(seed, 1)
    j = a_bone(project, random)
    try:
        edited, (upper, lower) = cut_bone(project, "shape 0", j, place, time)
    except InputError as refusal:
        assert "would leave no bone" in str(refusal)
        return
    if time is None and 0.0 < place < 1.0:
        # The rest pose of a cut is that of a node: a bone that was joined of bent ones bends there.
        project, _ = insert_node(project, "shape 0", j, place)
    turns, places = at(project, "shape 0", time)
    above, below = at(edited, upper, time), at(edited, lower, time)
    kept = [name for name in above[0] if name in turns]
    came = [name for name in below[0] if name in turns]
    assert_same_turns(turns, above[0], kept)
    assert_same_places(places, above[1], kept)
    assert_same_turns(turns, below[0], [name for name in came if name not in above[0]])
    assert_same_places(places, below[1], came)
    root = edited.shape(lower).skeleton.names[0]
    if root in above[1]:
        np.testing.assert_allclose(above[1][root], below[1][root], atol=1e-9)
    assert set(turns) <= set(above[0]) | set(below[0])


@laws
@given(SEEDS, MOMENTS, PLACES, TIMES)
def test_both_parts_of_a_cut_go_on_moving(seed, time, place, later):
    """Against the bone before it every bone turns as it did, but for the two halves."""
    project, random = random_project(seed, 1)
    j = a_bone(project, random)
    whole = project.shape("shape 0")
    try:
        edited, parts = cut_bone(project, "shape 0", j, place, time)
    except InputError:
        return
    turns = at(project, "shape 0", later)[0]
    for part in parts:
        skeleton = edited.shape(part).skeleton
        for i, name in enumerate(skeleton.names):
            above = skeleton.names[max(int(skeleton.parents[i]), 0)]
            if i and name in turns and above in turns and name != whole.skeleton.names[j]:
                now = at(edited, part, later)[0]
                v = np.array([1.0, 2.0, 3.0])
                old = rotate(turns[above] * [1, -1, -1, -1], rotate(turns[name], v))
                new = rotate(now[above] * [1, -1, -1, -1], rotate(now[name], v))
                np.testing.assert_allclose(old, new, atol=1e-9)


@laws
@given(SEEDS, MOMENTS, st.one_of(st.sampled_from([0.0, 1.0]), PLACES))
def test_a_merge_turns_nothing_at_its_time(seed, time, place):
    project, random = random_project(seed)
    host = project.shape("shape 0")
    j = int(random.integers(1 if place < 1 else 0, len(host.skeleton)))
    edited, names = merge(project, "shape 0", j, "shape 1", time, at=place)
    assert "shape 1" not in edited.shapes
    first, second, both = (
        at(project, "shape 0", time),
        at(project, "shape 1", time),
        at(edited, "shape 0", time),
    )
    assert_same_turns(first[0], both[0])
    assert_same_places(first[1], both[1])
    root = project.shape("shape 1").skeleton.names[0]
    moved = -second[1][root]
    for old, new in names.items():
        assert direction_error(project, edited, time, old, new) < 1e-9
    node = both_node(project, edited, j, place)
    for old, new in names.items():
        np.testing.assert_allclose(both[1][new], second[1][old] + moved + both[1][node], atol=1e-8)


@laws
@given(SEEDS, MOMENTS)
def test_a_grafted_bone_keeps_its_twist_too(seed, time):
    """D' R = D with one R for all bones of the graft, which turns their rest into the host's."""
    project, random = random_project(seed)
    j = int(random.integers(0, len(project.shape("shape 0").skeleton)))
    edited, names = merge(project, "shape 0", j, "shape 1", time)
    graft, whole = project.shape("shape 1"), edited.shape("shape 0")
    old, new = compute_pose(project, graft, time)[0], compute_pose(edited, whole, time)[0]
    pairs = [(graft.skeleton.index(a), whole.skeleton.index(b)) for a, b in names.items()]
    turns = np.array([multiply(conjugate(new[k]), old[i]) for i, k in pairs])
    assert angle(turns, np.broadcast_to(turns[0], turns.shape)) < 1e-9
    for i, k in pairs:
        rest = rotate(turns[0], graft.skeleton.vectors[i])
        np.testing.assert_allclose(rest, whole.skeleton.vectors[k], atol=1e-9)


def both_node(project, edited, j, place):
    skeleton = project.shape("shape 0").skeleton
    if place in (0.0, 1.0):
        return skeleton.names[j if place else skeleton.parents[j]]
    return edited.shape("shape 0").skeleton.names[j]


def direction_error(project, edited, time, old, new):
    """Returns the change of a grafted bone's direction, as a fraction of its length."""
    a, b = project.shape("shape 1"), edited.shape("shape 0")
    i, k = a.skeleton.index(old), b.skeleton.index(new)
    before = rotate(compute_pose(project, a, time)[0][i], a.skeleton.vectors[i])
    after = rotate(compute_pose(edited, b, time)[0][k], b.skeleton.vectors[k])
    return np.linalg.norm(before - after) / np.linalg.norm(before)


@laws
@given(SEEDS, MOMENTS, TIMES)
def test_a_merge_leaves_the_host_its_motion_and_the_graft_its_own(seed, time, later):
    project, random = random_project(seed)
    j = int(random.integers(0, len(project.shape("shape 0").skeleton)))
    edited, names = merge(project, "shape 0", j, "shape 1", time)
    first, both = at(project, "shape 0", later), at(edited, "shape 0", later)
    assert_same_turns(first[0], both[0])
    assert_same_places(first[1], both[1])
    # The graft moves in the node's frame as it moved in the world: only the frame differs, by a fixed turn
    # since the merge, W(later) W(merge)^-1.
    host = project.shape("shape 0")
    then, now = compute_pose(project, host, time)[0][j], compute_pose(project, host, later)[0][j]
    for old, new in names.items():
        a, b = project.shape("shape 1"), edited.shape("shape 0")
        i, k = a.skeleton.index(old), b.skeleton.index(new)
        before = rotate(compute_pose(project, a, later)[0][i], a.skeleton.vectors[i])
        carried = rotate(now, rotate(then * [1, -1, -1, -1], before))
        after = rotate(compute_pose(edited, b, later)[0][k], b.skeleton.vectors[k])
        np.testing.assert_allclose(after, carried, atol=1e-8)


@laws
@given(SEEDS, PLACES, MOMENTS)
def test_a_cut_and_a_merge_in_the_rest_pose_are_a_node(seed, place, time):
    project, random = random_project(seed, 1)
    j = a_bone(project, random)
    node, name = insert_node(project, "shape 0", j, place)
    parts, (upper, lower) = cut_bone(project, "shape 0", j, place, None, name=name)
    whole, names = merge(parts, upper, name, lower, None)
    assert all(old == new for old, new in names.items())
    a, b = at(node, "shape 0", time), at(whole, "shape 0", time)
    assert_same_turns(a[0], b[0])
    assert_same_places(a[1], b[1])


@laws
@given(SEEDS, MOMENTS, TIMES)
def test_a_node_between_two_takes_is_taken_out_with_both_kept(seed, time, later):
    """Figure 13: the paper invalidates both motions here."""
    project, _ = random_project(seed)
    host = project.shape("shape 0")
    leaf = next(j for j in range(len(host.skeleton) - 1, 0, -1) if not host.skeleton.children[j])
    edited, names = merge(project, "shape 0", leaf, "shape 1", time)
    removed = remove_node(edited, "shape 0", host.skeleton.names[leaf])
    before, after = at(edited, "shape 0", later)[0], at(removed, "shape 0", later)[0]
    assert_same_turns(before, after, after)
    inserted, _ = insert_node(removed, "shape 0", next(iter(names.values())), 0.37)
    assert_same_turns(after, at(inserted, "shape 0", later)[0])


def test_impossible_edit_is_reported_and_changes_nothing():
    project, _ = random_project(3)
    refused = [
        (lambda: insert_node(project, "shape 0", 0, 0.5), "root"),
        (lambda: insert_node(project, "shape 0", 1, 1.0), "cannot be inserted at an end of the bone"),
        (lambda: insert_node(project, "shape 0", 1, 1.5), "not a position"),
        (lambda: insert_node(project, "shape 0", 1, float("nan")), "not a position"),
        (lambda: insert_node(project, "shape 0", 1, 0.5, name="shape 0 joint 0"), "in use"),
        (lambda: insert_node(project, "nobody", 1, 0.5), "no shape"),
        (lambda: insert_node(project, "shape 0", "nothing", 0.5), "no joint 'nothing'"),
        (lambda: remove_node(project, "shape 0", 0), "root"),
        (lambda: remove_node(project, "shape 0", 99), "bone 99 does not exist"),
        (lambda: cut_bone(project, "shape 0", 0, 0.5, 0.0), "root"),
        (lambda: cut_bone(project, "shape 0", 1, 0.5, float("inf")), "time"),
        (lambda: merge(project, "shape 0", 0, "shape 0", 0.0), "itself"),
        (lambda: merge(project, "shape 0", 99, "shape 1", 0.0), "bone 99 does not exist"),
    ]
    for edit, word in refused:
        with pytest.raises(InputError, match=word):
            edit()
