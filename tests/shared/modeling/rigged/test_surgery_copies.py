"""Tests of copies, mirrors, scales and poses: their effect, and that they change nothing else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from layer_edits import set_layer
from surgery_worlds import angle, random_project, random_turns
from tolerances import assert_alike

from enliven.document.character import SkinWeights
from enliven.document.project import Project, are_identical
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh
from enliven.modeling.edits import (
    copy_character,
    mirror_character,
    move_character,
    paste_character,
    scale_character,
)
from enliven.modeling.rigged.posed import compute_pose
from enliven.modeling.rigged.posing import drag_joint, set_bone, turn_bone
from enliven.motion.layers.evaluate import evaluate_pose
from enliven.rotation import multiply

SEEDS = st.integers(0, 2**32 - 1)
TIMES = st.floats(-1.0, 3.0)
MOMENTS = st.one_of(st.none(), TIMES)
laws = settings(deadline=None, max_examples=25)


@laws
@given(SEEDS, TIMES, st.floats(-2, 2))
def test_a_copy_does_the_same_elsewhere_and_later(seed, time, delay):
    project, random = random_project(seed)
    away = random.normal(size=3)
    edited, copy = copy_character(project, "shape 0", offset=away, delay=delay)
    first, second = evaluate_pose(edited, "shape 0", time), evaluate_pose(edited, copy, time + delay)
    # A loop's seam may fall between the two times because the sum is rounded, so a millisecond is excluded.
    if not any(layer.loop for layer in project.shape("shape 0").layers):
        assert angle(first.turns, second.turns) < 1e-7
        np.testing.assert_allclose(first.joints + away, second.joints, atol=1e-7)
    assert are_identical(edited.shape("shape 0"), project.shape("shape 0"))


@laws
@given(SEEDS, TIMES)
def test_a_copy_has_layers_of_its_own(seed, time):
    project, _ = random_project(seed)
    edited, copy = copy_character(project, "shape 0")
    for layer in edited.shape(copy).layers:
        edited = set_layer(edited, copy, layer.id, weight=0.0)
    before = evaluate_pose(project, "shape 0", time)
    assert are_identical(evaluate_pose(edited, "shape 0", time).turns, before.turns)
    modeled = compute_pose(edited, edited.shape(copy), None)
    assert angle(evaluate_pose(edited, copy, time).turns, modeled[0]) < 1e-9


@laws
@given(SEEDS, TIMES)
def test_a_paste_into_another_project_moves_the_same(seed, time):
    source, _ = random_project(seed)
    other, _ = random_project(seed + 1)
    for target in (Project(), other, source):
        edited, copy = paste_character(target, source, "shape 1")
        first, second = evaluate_pose(source, "shape 1", time), evaluate_pose(edited, copy, time)
        assert are_identical(first.turns, second.turns)
        np.testing.assert_allclose(first.joints, second.joints, atol=1e-12)
        for shape_id in target.shapes:
            assert are_identical(edited.shape(shape_id), target.shape(shape_id))
        assert all(are_identical(edited.takes[name], take) for name, take in target.takes.items())
    twice, _ = paste_character(edited, source, "shape 1")
    assert len(twice.takes) == len(edited.takes)


@laws
@given(SEEDS, TIMES)
def test_a_mirror_shows_every_joint_on_the_other_side_at_every_time(seed, time):
    project, random = random_project(seed)
    normal = random.normal(size=3)
    edited = mirror_character(project, "shape 0", normal)
    shape = project.shape("shape 0")
    centre = shape.skeleton.positions[0] + shape.place
    unit = normal / np.linalg.norm(normal)
    before, after = (
        evaluate_pose(project, "shape 0", time).joints,
        evaluate_pose(edited, "shape 0", time).joints,
    )
    np.testing.assert_allclose(after, before - 2 * ((before - centre) @ unit)[:, None] * unit, atol=1e-8)
    other = evaluate_pose(edited, "shape 1", time)
    assert are_identical(other.joints, evaluate_pose(project, "shape 1", time).joints)
    back = evaluate_pose(mirror_character(edited, "shape 0", normal), "shape 0", time)
    assert angle(back.turns, evaluate_pose(project, "shape 0", time).turns) < 1e-8
    np.testing.assert_allclose(back.joints, before, atol=1e-8)


@laws
@given(SEEDS, TIMES, st.floats(0.1, 10))
def test_a_scaled_shape_turns_the_same_and_goes_as_much_farther(seed, time, factor):
    project, _ = random_project(seed)
    edited = scale_character(project, "shape 0", factor)
    first, second = evaluate_pose(project, "shape 0", time), evaluate_pose(edited, "shape 0", time)
    assert angle(first.turns, second.turns) < 1e-12
    shape = project.shape("shape 0")
    centre = shape.skeleton.positions[0] + shape.place
    np.testing.assert_allclose(second.joints - centre, factor * (first.joints - centre), atol=1e-8)


@laws
@given(SEEDS, MOMENTS)
def test_pose_has_requested_rotation_at_its_time(seed, time):
    project, random = random_project(seed, 1)
    shape = project.shape("shape 0")
    j = int(random.integers(0, len(shape.skeleton)))
    world, turn = random_turns(random), random_turns(random)
    edited = set_bone(project, "shape 0", j, world, time)
    assert angle(compute_pose(edited, edited.shape("shape 0"), time)[0][j], world) < 1e-9
    turned = turn_bone(project, "shape 0", j, turn, time)
    before, after = compute_pose(project, shape, time), compute_pose(turned, turned.shape("shape 0"), time)
    below = list(shape.skeleton.list_subtree(j))
    apart = [i for i in range(len(shape.skeleton)) if i not in below]
    assert angle(after[0][below], multiply(turn, before[0][below])) < 1e-9
    assert_alike(after[1][apart], before[1][apart])


@laws
@given(SEEDS, MOMENTS)
def test_a_dragged_joint_is_in_line_with_the_hand(seed, time):
    project, random = random_project(seed, 1)
    shape = project.shape("shape 0")
    j = int(random.integers(1, len(shape.skeleton)))
    point = random.normal(size=3) * 3
    edited = drag_joint(project, "shape 0", j, point, time)
    joints = compute_pose(edited, edited.shape("shape 0"), time)[1]
    start = joints[shape.skeleton.parents[j]]
    way, bone = point - start, joints[j] - start
    np.testing.assert_allclose(bone / np.linalg.norm(bone), way / np.linalg.norm(way), atol=1e-9)
    moved = drag_joint(project, "shape 0", 0, point, time)
    np.testing.assert_allclose(compute_pose(moved, moved.shape("shape 0"), time)[1][0], point, atol=1e-9)


def test_a_mirrored_mesh_keeps_its_outside():
    project, _ = random_project(5, 1)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    mesh = Mesh(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32))
    skin = SkinWeights(np.zeros((4, 4), np.uint16), np.eye(4, dtype=np.float32)[[0] * 4])
    project = project.with_characters(project.shape("shape 0").with_changes(mesh=mesh, skin=skin))
    mirrored = mirror_character(project, "shape 0", [1.0, 2.0, 0.0]).shape("shape 0").mesh
    assert volume(mirrored) == pytest.approx(volume(mesh)) == pytest.approx(1 / 6)


def volume(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def test_impossible_edit_is_reported():
    project, _ = random_project(3)
    refused = [
        (lambda: scale_character(project, "shape 0", 0.0), "cannot be scaled"),
        (lambda: scale_character(project, "shape 0", float("nan")), "cannot be scaled"),
        (lambda: mirror_character(project, "shape 0", np.zeros(3)), "direction"),
        (lambda: copy_character(project, "shape 0", offset=[0, 0, np.nan]), "copy"),
        (lambda: copy_character(project, "shape 9"), "no character"),
        (lambda: move_character(project, "shape 0", [0, np.inf, 0]), "the displacement"),
        (lambda: set_bone(project, "shape 0", 1, [0, 0, 0, 0]), "not a rotation"),
        (lambda: turn_bone(project, "shape 0", 1, [2, 0, 0, 0]), "not a rotation"),
        (lambda: drag_joint(project, "shape 0", 1, [0, 0]), "not a valid position"),
    ]
    for edit, word in refused:
        with pytest.raises(InputError, match=word):
            edit()
