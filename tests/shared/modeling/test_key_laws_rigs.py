"""Tests of keys of a bone, of a node and of a root, with the same properties for every rig that supports
them.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rig_worlds import WORLDS
from test_character_laws import near

from enliven.document import EASES, KEY_STEP, MotionKey, are_identical, make_keyed_stream
from enliven.errors import InputError
from enliven.exporters import sample_performance
from enliven.formats.project.file import parse_project, project_bytes
from enliven.modeling.edits import (
    change_layers,
    compute_vertices,
    copy_character,
    drag_handle,
    ease_key,
    find_keys,
    get_rig_edits,
    key_at,
    key_characters,
    key_handle,
    key_layer,
    merge_characters,
    mirror_character,
    move_character,
    move_key,
    pose_of_character,
    remove_key,
    root_motion,
    scale_character,
    set_key,
)
from enliven.modeling.possessed.pose import graph_pose
from enliven.rotation import from_rotation_vector, rotate, to_matrix

THINGS = (
    ("bones", 2),
    ("graph", 4),
    ("possessed", 7),
    ("bones", None),
    ("graph", None),
    ("points", None),
    ("cage", None),
)
things = pytest.mark.parametrize(("rig", "handle"), THINGS)
wholes = pytest.mark.parametrize("rig", ["bones", "graph", "points", "cage"])
nodes = pytest.mark.parametrize(("rig", "handle"), THINGS[1:3])
laws = settings(deadline=None, max_examples=6)
angles = st.tuples(*[st.floats(-170, 170)] * 3)
ways = st.tuples(*[st.floats(-1, 1)] * 3)
frames = st.lists(st.integers(0, 60), min_size=2, max_size=5, unique=True)


def keyed(rig, handle, at, degrees, metres, ease="smooth"):
    project, name = WORLDS[rig]
    for frame in at:
        more = {} if handle is not None and rig == "bones" else {"metres": metres}
        project = set_key(project, name, handle, frame * KEY_STEP, degrees, ease, **more)
    return project, name


@things
@laws
@given(frames, angles, ways, st.sampled_from(EASES), st.data())
def test_a_key_set_moved_or_eased_and_taken_back_is_nothing(rig, handle, at, degrees, way, ease, data):
    project, name = keyed(rig, handle, at[:-1], degrees, way, ease)
    more = set_key(project, name, handle, at[-1] * KEY_STEP, degrees)
    keys = find_keys(more, name, handle)
    number = [round(time / KEY_STEP) for time, _ in keys].index(at[-1])
    assert are_identical(remove_key(more, name, handle, number), project)
    other = data.draw(st.sampled_from(EASES))
    assert are_identical(
        ease_key(ease_key(more, name, handle, 0, other), name, handle, 0, keys[0][1].ease), more
    )
    away = move_key(more, name, handle, number, 2.5, (1, 2, 3))
    last = len(keys) - 1
    assert find_keys(away, name, handle)[last][1].degrees == (1, 2, 3)
    assert are_identical(move_key(away, name, handle, last, at[-1] * KEY_STEP, keys[number][1].degrees), more)
    assert are_identical(parse_project(project_bytes(more)), more), "kept in the file"


@things
@laws
@given(frames, angles, ways, st.floats(-0.5, 3))
def test_keys_of_anything_are_a_layer_as_any_other(rig, handle, at, degrees, way, time):
    project, name = keyed(rig, handle, at, degrees, way)
    plain, number = WORLDS[rig][0], key_layer(project, name, handle)
    muted = change_layers(project, name, [number], muted=True)
    near(compute_vertices(muted, name, time), compute_vertices(plain, name, time), 1e-9)
    layer = change_layers(project, name, [number], offset=0.5)
    last = max(at) * KEY_STEP
    assert find_keys(layer, name, handle)[-1][0] == pytest.approx(last + 0.5)
    copied, other = copy_character(project, name)
    changed = set_key(copied, other, handle, at[0] * KEY_STEP, (9, 9, 9))
    assert find_keys(changed, name, handle) == find_keys(project, name, handle), "a copy has keys of its own"
    assert key_at(changed, other, handle, at[0] * KEY_STEP).degrees == (9, 9, 9)


@wholes
@laws
@given(frames, angles, ways, st.floats(-0.5, 3))
def test_root_key_moves_character_rigidly(rig, at, degrees, way, time):
    project, name = keyed(rig, None, at[:1], degrees, way)
    plain = WORLDS[rig][0]
    project = set_key(project, name, None, at[1] * KEY_STEP, (0, 0, 0), metres=(0, 0, 0))
    key_time, stood = at[0] * KEY_STEP, get_rig_edits(plain.character(name)).centre(plain.character(name))
    turn, before = from_rotation_vector(np.radians(degrees)), compute_vertices(plain, name, key_time)
    near(compute_vertices(project, name, key_time), rotate(turn, before - stood) + stood + way)
    near(compute_vertices(project, name, at[1] * KEY_STEP), compute_vertices(plain, name, at[1] * KEY_STEP))
    with_key, unkeyed = compute_vertices(project, name, time), compute_vertices(plain, name, time)
    near(np.linalg.norm(with_key - with_key[0], axis=1), np.linalg.norm(unkeyed - unkeyed[0], axis=1))


@nodes
@laws
@given(frames, angles, ways)
def test_node_key_moves_node_and_not_distant_parts(rig, handle, at, degrees, way):
    project, name = keyed(rig, handle, at, degrees, way)
    plain, time = WORLDS[rig][0], at[0] * KEY_STEP
    before = graph_pose(plain, plain.graph(name), time)
    after = graph_pose(project, project.graph(name), time)
    near(after[1][handle], before[1][handle] + before[0][handle] @ way)
    turn = to_matrix(from_rotation_vector(np.radians(degrees)))
    near(after[0][handle], before[0][handle] @ turn)
    (layer,) = project.graph(name).over
    far = np.setdiff1d(np.arange(len(before[1])), layer.own)
    assert len(far) and len(layer.own) > 1
    near(after[1][far], before[1][far], 0)
    apart = np.linalg.norm(after[1] - before[1], axis=1)
    if not any(degrees):
        assert apart.argmax() == handle or apart.max() < 1e-9, "none goes farther"


@laws
@given(st.integers(2, 9), st.integers(0, 2**32 - 1), angles, ways)
def test_nodes_go_with_keys_as_one_by_one(count, seed, degrees, way):
    """The slow twin of the stream of keys: each node by itself."""
    random = np.random.default_rng(seed)
    rest, follow = random.normal(size=(count, 3)), random.uniform(0, 0.9, size=(count, 4))
    follow[0] = (1, 0, 0, 0)
    keys = [MotionKey(0.0), MotionKey(0.1, degrees, "linear", way)]
    stream = make_keyed_stream("keys", rest, follow, keys)
    for frame, share in enumerate((0.0, 1 / 3, 2 / 3, 1.0)):
        # Smooth from the first key: an S of three quarters.
        share = share * share * (3 - 2 * share)
        turn = to_matrix(from_rotation_vector(np.radians(share * np.array(degrees)))) - np.eye(3)
        for node in range(count):
            went = turn @ (rest[node] - rest[0]) + share * np.array(way)
            near(stream.positions[frame, node], rest[node] + follow[node, 0] * went, 1e-9)
            gradient = np.eye(3) + follow[node, 0] * turn + np.outer(went, follow[node, 1:])
            u, _, vt = np.linalg.svd(gradient)
            near(stream.linear[frame, node], u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt, 1e-6)


EDITS = {
    "as it is": lambda project, name: project,
    "moved": lambda p, name: move_character(p, name, (1, 0, 2), from_rotation_vector([0.3, 1, 0]), (1, 1, 0)),
    "scaled": lambda p, name: scale_character(p, name, 1.7),
    "mirrored": lambda p, name: mirror_character(p, name, (1, 0.4, 0)),
}


@things
@pytest.mark.parametrize("edit", EDITS)
@settings(deadline=None, max_examples=3)
@given(st.integers(0, 60), angles, ways, ways)
def test_dragged_key_reaches_target_and_keeps_other_keys(rig, handle, edit, frame, degrees, way, to):
    project, name = keyed(rig, handle, [90], degrees, way)
    project, time = EDITS[edit](project, name), frame * KEY_STEP
    late = compute_vertices(project, name, 3.0)
    if handle is None:
        turn = from_rotation_vector(np.radians(degrees))
        edited = key_characters(project, [name], time, to, turn, way)
        expected = rotate(turn, compute_vertices(project, name, time) - way) + way + to
        near(compute_vertices(edited, name, time), expected)
    else:
        player = get_rig_edits(project.character(name)).create_player(project, project.character(name))
        target = (player(time).handles if rig == "bones" else player(time).pose.positions)[handle] + to
        edited = key_handle(project, name, handle, target, time)
        if rig != "bones":  # a bone points there; see test_key_laws
            near(pose_of_character(edited, name, time).positions[handle], target, 1e-5)
    near(compute_vertices(edited, name, 3.0), late)


@wholes
def test_key_can_be_set_within_layers_and_next_to_another(rig):
    project, name = keyed(rig, None, [0, 30], (0, 40, 5), (0.2, 0.1, 0))
    first = key_layer(project, name, None)
    layer = project.character(name).playing[first]
    twice = project.character(name).with_playing(*project.character(name).playing, layer)
    project = change_layers(project.with_characters(twice), name, [first], weight=0.4)
    edited = key_characters(project, [name], 0.5, (0, 0, 1.0))
    near(compute_vertices(edited, name, 0.5), compute_vertices(project, name, 0.5) + np.array([0, 0, 1.0]))
    muted = change_layers(project, name, [first], muted=True)
    with pytest.raises(InputError, match="have no effect"):
        key_characters(muted, [name], 0.5, (0, 0, 1.0))


@wholes
def test_dragged_handle_of_keyed_character_reaches_target(rig):
    project, name = keyed(rig, None, [0, 30], (0, 40, 5), (0.2, 0.1, 0))
    if rig != "bones":
        return
    joints = get_rig_edits(project.shape(name)).create_player(project, project.shape(name))(0.4).handles
    for dragged in (
        drag_handle(project, name, 2, joints[2] + (0, 0.1, 0.1), 0.4),
        key_handle(project, name, 2, joints[2] + (0, 0.1, 0.1), 0.4),
    ):
        handles = get_rig_edits(dragged.shape(name)).create_player(dragged, dragged.shape(name))(0.4).handles
        way, bone = joints[2] + (0, 0.1, 0.1) - handles[1], handles[2] - handles[1]
        assert way @ bone / np.linalg.norm(way) / np.linalg.norm(bone) > 1 - 1e-9


@things
def test_export_contains_the_keys(rig, handle):
    project, name = keyed(rig, handle, [0, 30], (0, 40, 0), (0.3, 0.2, 0))
    motion, before = (compute_vertices(each, name, 1.0) for each in (project, WORLDS[rig][0]))
    assert np.abs(motion - before).max() > 0.02
    vertices = exported(project, name)
    if rig == "points":  # it is baked with its own error; the keys add none
        vertices = vertices - root_motion(project, project.character(name), 1.0)(
            exported(WORLDS[rig][0], name)
        )
        motion = np.zeros_like(vertices)
    near(vertices, motion, 1e-5)


def exported(project, name):
    """Returns (V, 3) metres of the last frame that is passed to an exporter, at 1 s."""
    performance = sample_performance(project, name, 0.0, 1.0, 10.0)
    pose = list(performance.poses())[-1]
    skin, mesh = performance.skin, performance.mesh
    arms = mesh.vertices[:, None] - performance.pivots[skin.indices]
    moved = np.einsum("vkij,vkj->vki", pose.linear[skin.indices].astype(float), arms)
    return ((moved + pose.positions[skin.indices]) * skin.weights[..., None]).sum(1)


@wholes
def test_a_merge_goes_on_with_the_keys_of_its_host(rig):
    project, name = keyed(rig, None, [0, 30], (0, 40, 0), (0.5, 0, 0))
    project, graft = copy_character(project, name, offset=(0.3, 0, 0))
    notes = []
    whole = merge_characters(project, name, graft, 0.5, loose=True, notes=notes)
    assert any("now follows" in note for note in notes)
    assert find_keys(whole, name, None) == find_keys(project, name, None) and list(whole.characters) == [name]


def test_character_without_keys_is_refused():
    for rig, handle, words in (
        ("points", 1, "node 1 does not exist"),
        ("cage", "front", "node 'front' does not exist"),
        ("graph", 99, "node 99 does not exist"),
        ("graph", "head", "node 'head' does not exist"),
    ):
        with pytest.raises(InputError, match=words):
            set_key(*WORLDS[rig], handle, 0.5)
    project, name = WORLDS["bones"]
    with pytest.raises(InputError, match="can only rotate"):
        set_key(project, name, 2, 0.5, metres=(1, 0, 0))
    with pytest.raises(InputError, match="cannot have keys"):
        key_handle(*WORLDS["points"], 1, (0, 0, 0), 0.5)
    for wrong in ((lambda: key_characters(project, [name], 0.5, (0, np.nan, 0))),):
        with pytest.raises(InputError, match="the displacement"):
            wrong()
