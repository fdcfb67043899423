"""Tests of edits of whole characters for all rigs: skeleton, deformation graph, puppet, and the tests' own
cage.

Everything that the cage rig needs is in tests/helpers/cage.py.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rig_worlds import ALL, GRAPHS, RIGS, WORLDS, kind, rigs, worlds
from surgery_worlds import random_turns, tube

from enliven.document.history import History
from enliven.document.naming import unused
from enliven.document.project import Project, are_identical
from enliven.errors import InputError
from enliven.examples.puppet_motion import convert_to_world_frame
from enliven.exporters import sample_performance
from enliven.formats.project.file import parse_project, project_bytes
from enliven.formats.project.one_character import character_bytes, project_of_mesh
from enliven.modeling.edits import (
    change_layers,
    compute_vertices,
    copy_character,
    cut_character,
    delete_character,
    drag_handle,
    get_rig_edits,
    merge_characters,
    mirror_character,
    move_character,
    paste_character,
    pose_of_character,
    remove_layer,
    rename_character,
    root_motion,
    scale_character,
    shift_character,
    turn_character,
)
from enliven.modeling.mesh.cut_surfaces import PlaneCut
from enliven.modeling.puppet.dragging import key_pose_at
from enliven.modeling.puppet.parts import evaluate_puppet_state
from enliven.rotation import rotate

laws = settings(deadline=None, max_examples=6)
TIMES = st.floats(-0.5, 3.0)
SEEDS = st.integers(0, 2**32 - 1)
FAR = PlaneCut([99.0, 0, 0], [1.0, 0, 0])
NEAR = 1e-6
"""Tolerance in metres: rounding, and the convergence limit of the iterative solver for a puppet's surface."""


def near(found, expected, within=NEAR):
    np.testing.assert_allclose(found, expected, atol=within, rtol=0)


def centre_of(project, name):
    return get_rig_edits(project.characters[name]).centre(project.characters[name])


@worlds
@laws
@given(seed=SEEDS, time=TIMES)
def test_a_move_commutes_with_time(rig, seed, time):
    project, name = WORLDS[rig]
    random = np.random.default_rng(seed)
    turn, offset, about = random_turns(random), random.normal(size=3), random.normal(size=3)
    moved = move_character(project, name, offset, turn, about)
    expected = rotate(turn, compute_vertices(project, name, time) - about) + about + offset
    near(compute_vertices(moved, name, time), expected)
    centre = centre_of(project, name)
    turned = turn_character(project, name, turn)
    near(
        compute_vertices(turned, name, time),
        rotate(turn, compute_vertices(project, name, time) - centre) + centre,
    )


@worlds
@laws
@given(factor=st.floats(0.3, 3.0), time=TIMES)
def test_a_scale_commutes_with_time(rig, factor, time):
    project, name = WORLDS[rig]
    centre = centre_of(project, name)
    seen = compute_vertices(scale_character(project, name, factor), name, time)
    near(seen, centre + factor * (compute_vertices(project, name, time) - centre), 3 * NEAR)


@worlds
@laws
@given(seed=SEEDS, time=TIMES)
def test_a_mirror_commutes_with_time_and_twice_is_nothing(rig, seed, time):
    project, name = WORLDS[rig]
    normal = np.random.default_rng(seed).normal(size=3)
    normal /= np.linalg.norm(normal)
    once = mirror_character(project, name, normal)
    before, centre = compute_vertices(project, name, time), centre_of(project, name)
    away = (before - centre) @ normal
    near(compute_vertices(once, name, time), before - 2 * away[:, None] * normal, 3 * NEAR)
    twice = mirror_character(once, name, normal)
    near(compute_vertices(twice, name, time), before, 3 * NEAR)
    near(
        get_rig_edits(twice.characters[name]).rest(twice.characters[name]),
        get_rig_edits(project.characters[name]).rest(project.characters[name]),
    )
    assert (twice.characters[name].mesh.faces == project.characters[name].mesh.faces).all()


@worlds
@laws
@given(delay=st.integers(-8, 8).map(lambda n: n / 4), time=st.integers(0, 40).map(lambda n: n / 16 + 1 / 64))
def test_a_shift_in_time_commutes_with_time(rig, delay, time):
    project, name = WORLDS[rig]
    shifted = shift_character(project, name, delay)
    near(compute_vertices(shifted, name, time + delay), compute_vertices(project, name, time))


@worlds
@laws
@given(time=TIMES, later=TIMES)
def test_muted_layer_has_no_effect(rig, time, later):
    project, name = WORLDS[rig]
    count = len(project.characters[name].playing)
    silent = change_layers(project, name, range(count), muted=True)
    near(compute_vertices(silent, name, time), compute_vertices(silent, name, later), 1e-12)
    assert silent.end_of(silent.characters[name]) == 0.0
    heard = change_layers(silent, name, range(count), muted=False)
    assert are_identical(heard, project)


@rigs
@laws
@given(speed=st.sampled_from([0.5, 2.0, -1.0]), time=st.floats(0.1, 1.4))
def test_a_layer_twice_as_fast_plays_the_same_in_half_the_time(rig, speed, time):
    project, name = WORLDS[rig]
    count = len(project.characters[name].playing)
    plain = change_layers(project, name, range(count), offset=0.0, speed=1.0, loop=False)
    fast = change_layers(plain, name, range(count), speed=speed)
    (length,) = {plain.length_of(layer) for layer in plain.characters[name].playing}
    second = min(max(time * speed + (length if speed < 0 else 0.0), 0.0), length)
    near(compute_vertices(fast, name, time), compute_vertices(plain, name, second))


@worlds
@laws
@given(seed=SEEDS, time=TIMES)
def test_copy_moves_alike_and_deleting_restores_project(rig, seed, time):
    project, name = WORLDS[rig]
    offset = np.random.default_rng(seed).normal(size=3)
    copied, copy = copy_character(project, name, offset=offset)
    near(compute_vertices(copied, copy, time), compute_vertices(project, name, time) + offset)
    assert copy != name and are_identical(copied.characters[name], project.characters[name])
    assert are_identical(delete_character(copied, copy), project)
    late, copy = copy_character(project, name, delay=0.25)
    near(compute_vertices(late, copy, 1.25), compute_vertices(project, name, 1.0))
    quiet = change_layers(copied, copy, range(len(copied.characters[copy].playing)), muted=True)
    assert are_identical(quiet.characters[name], project.characters[name])


@worlds
@laws
@given(time=TIMES)
def test_a_paste_into_another_project_plays_the_same(rig, time):
    project, name = WORLDS[rig]
    for target in (Project(), project, WORLDS[ALL[ALL.index(rig) - 1]][0]):
        pasted, copy = paste_character(target, project, name)
        near(compute_vertices(pasted, copy, time), compute_vertices(project, name, time))
        again, _ = paste_character(pasted, project, name)
        assert list(again.takes) == list(pasted.takes) and list(again.streams) == list(pasted.streams)


@worlds
@settings(deadline=None, max_examples=2)
@given(along=st.floats(0.3, 0.7), time=st.floats(0.0, 1.5))
def test_at_the_time_of_a_cut_nothing_moves_and_of_a_merge_neither(rig, along, time):
    project, name = WORLDS[rig]
    if kind(rig) == "points":
        # A moment of one take alone can become a key pose, which the halves keep.
        puppet = project.puppet(name)
        project = project.with_characters(puppet.with_playing(puppet.layers[0], *puppet.root_layers))
    seen = compute_vertices(project, name, time)
    axis = np.linalg.svd(seen - seen.mean(0), full_matrices=False)[2][0]
    low, high = np.percentile((seen - seen.mean(0)) @ axis, [0, 100])
    plane = PlaneCut(seen.mean(0) + (low + along * (high - low)) * axis, axis)
    notes: list[str] = []
    cut, parts = cut_character(project, name, plane, time, notes=notes)
    assert parts[0] == name and len(parts) == 2
    size = float(np.linalg.norm(np.ptp(seen, axis=0)))
    # In its key poses, a half of a puppet stays within 2 % of its place (MAX_HALF_DEVIATION). The pose of
    # this moment is a mixture of them. A bone's skin near a joint follows bones of both sides, and one of
    # them after the cut. A graph keeps every vertex to rounding.
    within = {"points": 0.04 * size, "bones": 0.02 * size}.get(kind(rig), NEAR)
    for part in parts:
        assert off_surface(compute_vertices(cut, part, time), seen, plane) < within
    whole = merge_characters(cut, name, parts[1], time, loose=True)
    assert list(whole.characters) == [name]
    assert off_surface(compute_vertices(whole, name, time), seen, plane) < 2 * within + 0.03 * size


def off_surface(found, seen, plane):
    """Returns metres between vertices away from a cut and the nearest vertex before the cut."""
    away = np.abs(plane.compute_distances(found)) > 0.12 * float(np.linalg.norm(np.ptp(seen, axis=0)))
    if not away.any():
        return 0.0
    return float(np.linalg.norm(found[away][:, None] - seen[None], axis=2).min(1).max())


def random_edit(project, random):
    """Applies a random edit to a random character of any rig."""
    name = str(random.choice(list(project.characters)))
    match int(random.integers(9)):
        case 0:
            return copy_character(project, name, offset=random.normal(size=3))[0]
        case 1:
            return move_character(project, name, random.normal(size=3), random_turns(random))
        case 2:
            return scale_character(project, name, float(random.uniform(0.5, 2)))
        case 3:
            return mirror_character(project, name, random.normal(size=3))
        case 4:
            return shift_character(project, name, float(random.normal()))
        case 5:
            return change_layers(project, name, [0], muted=bool(random.random() < 0.5))
        case 6:
            return rename_character(project, name, unused(f"{name} so", project.characters))
        case 7 if len(project.characters) > 2:
            return delete_character(project, name)
        case _:
            return change_layers(project, name, [0], speed=float(random.choice([-1.0, 0.5, 2.0])))


@settings(deadline=None, max_examples=3)
@given(seed=SEEDS)
def test_undo_restores_characters_of_all_rigs_bit_for_bit(seed):
    random, project = np.random.default_rng(seed), Project()
    for source, name in (WORLDS[rig] for rig in RIGS):
        project, _ = paste_character(project, source, name)
    history, states = History(project), [project]
    for number in range(60):
        states.append(history.record_edit(f"edit {number}", random_edit(history.project, random)))
    for before in reversed(states[:-1]):
        assert are_identical(history.undo(), before)
    for after in states[1:]:
        assert are_identical(history.redo(), after)


@worlds
@laws
@given(seed=SEEDS, time=st.floats(0.0, 1.5))
def test_a_handle_that_is_dragged_is_there_at_that_time(rig, seed, time):
    """The root of a skeleton goes there; another joint points there; what was recorded is not posed."""
    project, name = WORLDS[rig]
    character, random = project.character(name), np.random.default_rng(seed)
    player = get_rig_edits(character).create_player(project, character)
    handles = player(time).handles
    assert len(handles) == len(character.handles) == len(character.parents)
    if not len(handles):
        with pytest.raises(InputError, match="cannot be dragged"):
            get_rig_edits(character).drag_handle(project, character, 0, np.zeros(3), time)
        return
    number = int(random.integers(len(handles)))
    place = handles[number] + 0.05 * random.normal(size=3)
    dragged = drag_handle(project, name, character.handles[number], place, time)
    edited = dragged.character(name)
    ends = get_rig_edits(edited).create_player(dragged, edited)(time).handles
    if kind(rig) == "points":
        # The moment is a key pose of the nearest frame of the take; it is met as closely as examples are.
        layer = character.layers[0]
        second = layer.find_played_time(time, project.takes[layer.take].duration)[0]
        pose = edited.poses[key_pose_at(dragged, edited, layer.take, second)]
        place_now = convert_to_world_frame(
            character, evaluate_puppet_state(project, character, time), pose.places[number]
        )
        near(root_motion(project, character, time)(place_now[None])[0], place)
    elif character.parents[number] >= 0:
        start = ends[character.parents[number]]
        ways = [(each - start) / np.linalg.norm(each - start) for each in (ends[number], place)]
        near(ways[0], ways[1], 1e-6)
    else:
        near(ends[number], place)
    for wrong, words in (
        ("ghost", "no handle 'ghost'"),
        (99, "no handle 99"),
    ):
        with pytest.raises(InputError, match=words):
            drag_handle(project, name, wrong, place, time)
    with pytest.raises(InputError, match="not a valid position"):
        drag_handle(project, name, 0, [0, np.nan, 0], time)


@worlds
def test_layer_removal_works_or_gives_the_reason(rig):
    project, name = WORLDS[rig]
    if kind(rig) in GRAPHS:
        with pytest.raises(InputError, match="no other motion"):
            remove_layer(project, name, 0)
        return
    left = project
    while left.character(name).playing:
        before = left.character(name).playing
        left = remove_layer(left, name, 0)
        assert [
            are_identical(a, b) for a, b in zip(left.character(name).playing, before[1:], strict=True)
        ] == [True] * (len(before) - 1)
    near(compute_vertices(left, name, 0.3), compute_vertices(left, name, 1.3), 1e-12)
    with pytest.raises(InputError, match="no layer 0"):
        remove_layer(left, name, 0)


@worlds
def test_every_rig_is_stored_and_sampled(rig):
    """Project files and exporters support every rig, without code for a rig unless it is needed."""
    project, name = WORLDS[rig]
    assert are_identical(parse_project(project_bytes(project)), project)
    performance = sample_performance(project, name, 0.0, 0.5, rate=10.0)
    assert performance.name == name and len(list(performance.poses())) == 6


@worlds
def test_the_pose_for_viewers_and_the_name(rig):
    project, name = WORLDS[rig]
    pose = pose_of_character(project, name, 0.5)
    drawn = get_rig_edits(project.characters[name]).make_drawing(project.characters[name])
    assert pose.character == drawn.id == name and len(pose.positions) == len(drawn.pivots)
    renamed = rename_character(project, name, "other")
    assert list(renamed.characters) == ["other"] and renamed.character("other").id == "other"
    near(compute_vertices(renamed, "other", 0.5), compute_vertices(project, name, 0.5))


@worlds
def test_impossible_edit_is_reported(rig):
    project, name = WORLDS[rig]
    two, copy = copy_character(project, name)
    refused = [
        (lambda: copy_character(project, "ghost"), "no character 'ghost'"),
        (lambda: copy_character(project, name, offset=[0, 0, np.nan]), "copy"),
        (lambda: copy_character(project, name, delay=np.inf), "copy"),
        (lambda: delete_character(project, "ghost"), "no character"),
        (lambda: move_character(project, name, [0, np.inf, 0]), "the displacement"),
        (lambda: move_character(project, name, [0, 0, 0], [2.0, 0, 0, 0]), "the displacement"),
        (lambda: scale_character(project, name, 0.0), "cannot be scaled"),
        (lambda: mirror_character(project, name, np.zeros(3)), "direction"),
        (lambda: shift_character(project, name, np.nan), "is not valid"),
        (lambda: change_layers(project, name, [99], muted=True), "no layer 99"),
        (lambda: change_layers(project, name, [0], speed=0.0), "is not valid"),
        (lambda: rename_character(two, copy, name), "already has the name"),
        (lambda: rename_character(project, name, ""), "the new name is empty"),
        (lambda: merge_characters(project, name, name, 0.0), "itself"),
        (
            lambda: cut_character(project, name, PlaneCut([99.0, 0, 0], [1.0, 0, 0]), 0.0),
            "does not cross the mesh|no bone|nothing",
        ),
    ]
    for edit, words in refused:
        with pytest.raises(InputError, match=words):
            edit()
    assert rename_character(project, name, name) is project


@worlds
@laws
@given(seed=SEEDS, cut=st.floats(0, 1, exclude_max=True))
def test_sent_character_is_at_rest_and_partial_data_is_refused(rig, seed, cut):
    project, name = WORLDS[rig]
    random = np.random.default_rng(seed)
    project = move_character(
        project, name, random.normal(size=3), random_turns(random), random.normal(size=3)
    )
    data = character_bytes(project, name)
    sent, original = parse_project(data), project.characters[name]
    (received,) = sent.characters.values()
    near(received.mesh.vertices, original.mesh.vertices.astype(np.float32).astype(float), 0)
    assert (
        type(received) is type(original)
        and received.id == name
        and np.array_equal(received.mesh.faces, original.mesh.faces)
    )
    assert not received.playing or kind(rig) in GRAPHS
    assert not sent.takes or kind(rig) == "points"
    assert all(len(stream.positions) == 1 for stream in sent.streams.values())
    assert are_identical(sent, parse_project(character_bytes(sent, name))), "what is sent again is the same"
    with pytest.raises(InputError):
        parse_project(data[: int(cut * len(data))])


def test_plain_mesh_is_sent_unchanged():
    mesh = tube()
    sent = parse_project(character_bytes(project_of_mesh(mesh, "post"), "post"))
    near(sent.graph("post").mesh.vertices, mesh.vertices, 1e-6)
    with pytest.raises(InputError, match="unpack"):
        parse_project(character_bytes(sent, "post"), most=1000)
