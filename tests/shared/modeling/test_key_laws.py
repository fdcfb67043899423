"""Tests of keys on a bone over its motion: the bone has the key's rotation at a key, and interpolates between
keys.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_character_laws import WORLDS

from enliven.document import EASES, KEY_STEP, MotionKey, Project, are_identical, clip_from_keys, key_values
from enliven.errors import InputError
from enliven.exporters import sample_performance
from enliven.formats.project.file import parse_project, project_bytes
from enliven.modeling.edits import (
    change_layers,
    compute_vertices,
    copy_character,
    ease_key,
    find_keys,
    key_at,
    key_handle,
    key_layer,
    mirror_character,
    move_key,
    remove_key,
    set_key,
    shift_character,
)
from enliven.modeling.rigged.posed import compute_pose
from enliven.rotation import from_rotation_vector, multiply, to_matrix

PROJECT, ARM = WORLDS["bones"]
BONE = 2
laws = settings(deadline=None, max_examples=25)
angles = st.tuples(*[st.floats(-170, 170)] * 3)
frames = st.lists(st.integers(0, 90), min_size=1, max_size=6, unique=True)


def keyed(at: list[int], degrees: list, ease: str = "smooth", project: Project = PROJECT) -> Project:
    for frame, each in zip(at, degrees, strict=False):
        project = set_key(project, ARM, BONE, frame * KEY_STEP, each, ease)
    return project


def turn_apart(a, b) -> float:
    return float(np.minimum(np.abs(a - b).max(), np.abs(a + b).max()))


@laws
@given(frames, st.lists(angles, min_size=6, max_size=6), st.sampled_from(EASES))
def test_key_rotates_bone_after_its_motion(at, degrees, ease):
    project = keyed(at, degrees, ease)
    for frame, each in zip(at, degrees, strict=False):
        time = frame * KEY_STEP
        before, turns = (
            compute_pose(PROJECT, PROJECT.shape(ARM), time)[0],
            compute_pose(project, project.shape(ARM), time)[0],
        )
        wanted = multiply(before[BONE], from_rotation_vector(np.radians(each)))
        assert turn_apart(turns[BONE], wanted) < 1e-9
        assert turn_apart(turns[:BONE], before[:BONE]) < 1e-12, "what it hangs on stays"
        assert key_at(project, ARM, BONE, time).degrees == pytest.approx(each)
    assert [key.second for _, key in find_keys(project, ARM, BONE)] == pytest.approx(
        sorted(frame * KEY_STEP for frame in at)
    )


kinds = st.tuples(st.integers(0, 60), angles, st.sampled_from(EASES))


@laws
@given(st.lists(kinds, min_size=1, max_size=6, unique_by=lambda one: one[0]), st.floats(-1, 4))
def test_between_two_keys_no_channel_goes_beyond_either(keys, second):
    ordered = sorted((MotionKey(f * KEY_STEP, d, e) for f, d, e in keys), key=lambda one: one.second)
    (values,) = key_values(ordered, np.array([second]))[:, :3]
    before = [key for key in ordered if key.second <= second + 1e-9] or ordered[:1]
    after = [key for key in ordered if key.second > second] or ordered[-1:]
    ends = np.array([before[-1].degrees, after[0].degrees])
    assert (values >= ends.min(0) - 1e-9).all() and (values <= ends.max(0) + 1e-9).all()
    for key in ordered:
        assert key_values(ordered, np.array([key.second]))[:, :3][0] == pytest.approx(key.degrees, abs=1e-9)
    near = key_values(ordered, np.array([second, second + 1e-5]))[:, :3]
    if all(ease != "step" for _, _, ease in keys):
        assert np.abs(np.diff(near, axis=0)).max() < 1.0, "no jump without a step"


@laws
@given(frames, st.lists(angles, min_size=6, max_size=6), st.data())
def test_a_key_that_is_set_and_removed_is_nothing(at, degrees, data):
    project = PROJECT
    for frame, each in zip(at[:-1], degrees, strict=False):
        project = set_key(project, ARM, BONE, frame * KEY_STEP, each)
    more = set_key(project, ARM, BONE, at[-1] * KEY_STEP, degrees[0])
    number = [round(key.second / KEY_STEP) for _, key in find_keys(more, ARM, BONE)].index(at[-1])
    assert are_identical(remove_key(more, ARM, BONE, number), project)
    eased = ease_key(more, ARM, BONE, number, data.draw(st.sampled_from(EASES)))
    assert are_identical(ease_key(eased, ARM, BONE, number, "smooth"), more)


@laws
@given(frames, angles, st.integers(0, 90), angles)
def test_a_key_is_moved_in_time_and_value_and_back(at, first, frame, other):
    project = keyed(at, [first] * len(at))
    keys = find_keys(project, ARM, BONE)
    time, key = keys[0]
    if any(abs(other_key.second - frame * KEY_STEP) < 1e-6 for _, other_key in keys[1:]):
        with pytest.raises(InputError, match="on the same frame"):
            move_key(project, ARM, BONE, 0, frame * KEY_STEP, other)
        return
    moved = move_key(project, ARM, BONE, 0, frame * KEY_STEP, other)
    number = [round(key.second / KEY_STEP) for _, key in find_keys(moved, ARM, BONE)].index(frame)
    assert find_keys(moved, ARM, BONE)[number][1].degrees == other
    assert are_identical(move_key(moved, ARM, BONE, number, time, key.degrees), project)


@laws
@given(frames, angles, st.floats(-1, 4), st.floats(0, 2))
def test_keys_are_a_layer_as_any_other(at, degrees, time, delay):
    project = keyed(at, [degrees] * len(at))
    number = key_layer(project, ARM, BONE)
    assert number is not None
    muted = change_layers(project, ARM, [number], muted=True)
    np.testing.assert_allclose(
        compute_vertices(muted, ARM, time), compute_vertices(PROJECT, ARM, time), atol=1e-9
    )
    shifted = shift_character(project, ARM, delay)
    np.testing.assert_allclose(
        compute_vertices(shifted, ARM, time + delay), compute_vertices(project, ARM, time), atol=1e-6
    )
    assert are_identical(parse_project(project_bytes(project)), project), "kept in the file"


@laws
@given(st.integers(0, 60), st.tuples(*[st.floats(-2, 2)] * 3), st.booleans())
def test_posed_by_hand_a_key_points_there_and_other_keys_stay(frame, place, mirrored):
    project, time = PROJECT, frame * KEY_STEP
    if mirrored:
        project = mirror_character(set_key(PROJECT, ARM, BONE, 3.0, (10, 0, 0)), ARM, [1.0, 0, 0])
    edited = key_handle(project, ARM, BONE, place, time)
    joints = compute_pose(edited, edited.shape(ARM), time)[1]
    start = joints[BONE - 1] if int(edited.shape(ARM).skeleton.parents[BONE]) == BONE - 1 else joints[0]
    way, bone = np.array(place) - start, joints[BONE] - start
    if np.linalg.norm(way) > 1e-3:
        cosine = way @ bone / np.linalg.norm(way) / np.linalg.norm(bone)
        assert cosine > 1 - 1e-9
    if mirrored and frame < 90:
        after, before = (compute_pose(each, each.shape(ARM), 3.0)[1] for each in (edited, project))
        np.testing.assert_allclose(after, before, atol=1e-9)


def test_a_copy_has_keys_of_its_own():
    project = set_key(PROJECT, ARM, BONE, 0.5, (0, 40, 0))
    project, other = copy_character(project, ARM)
    changed = set_key(project, other, BONE, 0.5, (0, -40, 0))
    assert find_keys(changed, ARM, BONE) == find_keys(project, ARM, BONE)
    assert find_keys(changed, other, BONE)[0][1].degrees == (0, -40, 0)


def test_export_contains_the_keys():
    project = set_key(set_key(PROJECT, ARM, BONE, 0.0, (0, 0, 0)), ARM, BONE, 1.0, (0, 60, 0))
    performance = sample_performance(project, ARM, 0.0, 1.0, 30.0)
    last = compute_pose(project, project.shape(ARM), 1.0)[0]
    np.testing.assert_allclose(performance.linear[-1], to_matrix(last), atol=1e-6)
    assert turn_apart(last[BONE], compute_pose(PROJECT, PROJECT.shape(ARM), 1.0)[0][BONE]) > 0.1


def test_invalid_key_is_refused():
    project = set_key(PROJECT, ARM, BONE, 0.5, (0, 40, 0))
    late = change_layers(project, ARM, [key_layer(project, ARM, BONE)], offset=1.0)
    for wrong, words in (
        (lambda: set_key(PROJECT, ARM, "nose", 0.5), "no joint 'nose'"),
        (lambda: set_key(PROJECT, ARM, BONE, 0.5, (0, np.nan, 0)), "invalid time or value"),
        (
            lambda: set_key(PROJECT, ARM, BONE, 0.5, (0, 0, 0), "bounce"),
            "with the interpolation .* is not valid",
        ),
        (lambda: ease_key(project, ARM, BONE, 4, "step"), "key 4 does not exist"),
        (lambda: remove_key(PROJECT, ARM, BONE, 0), "key 0 does not exist"),
        (lambda: key_handle(PROJECT, ARM, 0, (0, 0, 0), 0.0), "no bone ends there"),
        (lambda: set_key(late, ARM, BONE, 0.2, (0, 0, 0)), "the start of its clip at 1.00 s"),
        (lambda: clip_from_keys("keys", "arm", []), "the list of keys is empty"),
    ):
        with pytest.raises(InputError, match=words):
            wrong()
    assert replace(find_keys(project, ARM, BONE)[0][1], ease="step").ease == "step"
