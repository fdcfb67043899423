"""Tests of edits of a shape with a mesh: skeleton, surface, weights and layers change together."""

import numpy as np
import pytest
from surgery_worlds import about_z, angle, bending_arm
from tolerances import assert_alike

from enliven.document.layers import Ref, Span
from enliven.document.project import are_identical
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh
from enliven.modeling.edits import copy_character, move_character
from enliven.modeling.mesh.cut_surfaces import PlaneCut, StrokeCut
from enliven.modeling.mesh.meshes import compute_posed_vertices
from enliven.modeling.rigged.cutting import cut_bone
from enliven.modeling.rigged.merging import merge
from enliven.modeling.rigged.nodes import insert_node, remove_node
from enliven.modeling.rigged.posed import compute_pose, pose_with_stretch
from enliven.modeling.rigged.posing import set_bone, turn_bone
from enliven.modeling.rigged.stroke_cut import cut_shape_along_stroke
from enliven.motion.layers.evaluate import evaluate_pose


@pytest.fixture(scope="module")
def arm():
    """Returns a tube of two bones that a take bends by 60 degrees in a second."""
    return bending_arm()


def surface(project, shape_id, time):
    shape = project.shape(shape_id)
    pose = pose_with_stretch(project, shape, time)
    return compute_posed_vertices(shape, pose.linear, pose.joints)


def volume(vertices, faces):
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def closed(mesh):
    """Checks that every edge is used exactly once in each direction."""
    edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    ways = {tuple(edge) for edge in edges.tolist()}
    return len(ways) == len(edges) and all((b, a) in ways for a, b in ways)


def test_removing_inserted_node_restores_skin_weights(arm):
    edited, name = insert_node(arm, "arm", 2, 0.4)
    before, after = arm.shape("arm").skin, edited.shape("arm").skin
    np.testing.assert_allclose(after.weights.sum(1), 1, atol=1e-6)
    x = arm.shape("arm").mesh.vertices[:, 0]
    node = edited.shape("arm").skeleton.index(name)
    share = np.where(after.indices == node, after.weights, 0).sum(1)
    assert share[(x > 2.3) & (x < 2.7)].min() > 0.5
    assert share[x > 3.4].max() == 0
    back = remove_node(edited, "arm", name)
    dense = [np.zeros((len(x), 3)) for _ in range(2)]
    for full, skin in zip(dense, (before, back.shape("arm").skin), strict=True):
        np.add.at(full, (np.arange(len(x))[:, None], skin.indices), skin.weights)
    assert_alike(*dense)


@pytest.mark.parametrize("time", [None, 0.0, 0.7])
@pytest.mark.parametrize("place", [0.3, 0.65])
def test_a_cut_makes_two_closed_meshes_that_lie_where_they_lay(arm, place, time):
    edited, (upper, lower) = cut_bone(arm, "arm", "arm 2", place, time)
    whole = arm.shape("arm").mesh
    parts = [edited.shape(part).mesh for part in (upper, lower)]
    assert all(closed(mesh) for mesh in parts)
    total = sum(volume(mesh.vertices, mesh.faces) for mesh in parts)
    assert total == pytest.approx(volume(whole.vertices, whole.faces), rel=1e-9)
    at = 2 + 2 * place
    assert parts[0].vertices[:, 0].max() == pytest.approx(at, abs=0.05)
    if time is None:
        arm, _ = insert_node(arm, "arm", "arm 2", place)
    before = surface(arm, "arm", time)
    # A vertex that followed a bone beyond the cut now follows the bone at the cut. Others keep their weights.
    bones = [np.where(arm.shape("arm").skin.indices == j, arm.shape("arm").skin.weights, 0) for j in (1, 2)]
    number = {tuple(v): i for i, v in enumerate(whole.vertices)}
    for part, other in ((upper, 0.0), (lower, bones[0].sum(1))):
        mesh, after = edited.shape(part).mesh, surface(edited, part, time)
        kept = [(number[tuple(v)], i) for i, v in enumerate(mesh.vertices) if tuple(v) in number]
        old, new = np.array(kept).T
        apart = np.linalg.norm(after[new] - before[old], axis=1)
        assert (apart <= 1e-6 + 4 * np.broadcast_to(other, len(before))[old]).all()
        assert len(kept) > 100 or part == lower


def test_both_parts_go_on_moving(arm):
    edited, parts = cut_bone(arm, "arm", "arm 2", 0.5, 0.5)
    for part in parts:
        first, second = surface(edited, part, 0.0), surface(edited, part, 1.0)
        assert np.linalg.norm(first - second, axis=1).max() > 0.1


def test_a_merge_in_the_rest_pose_makes_a_cut_arm_whole(arm):
    edited, (upper, lower) = cut_bone(arm, "arm", "arm 2", 0.5, None, name="cut")
    notes = []
    whole, _ = merge(edited, upper, "cut", lower, None, notes=notes)
    mesh, before = whole.shape("arm").mesh, arm.shape("arm").mesh
    assert closed(mesh)
    assert volume(mesh.vertices, mesh.faces) == pytest.approx(volume(before.vertices, before.faces), rel=0.02)
    node, _ = insert_node(arm, "arm", "arm 2", 0.5, name="cut")
    for time in (0.0, 0.6, 1.0):
        np.testing.assert_allclose(
            evaluate_pose(whole, "arm", time).joints, evaluate_pose(node, "arm", time).joints, atol=1e-9
        )


@pytest.mark.parametrize("time", [0.0, 0.4, 1.0])
def test_graft_keeps_world_pose_and_follows_host(arm, time):
    project, copy = copy_character(arm, "arm")
    project = turn_bone(project, copy, 0, about_z(75), time)
    node = evaluate_pose(project, "arm", time).joints[1]
    project = move_character(project, copy, node - evaluate_pose(project, copy, time).joints[0])
    seen = surface(project, copy, time)
    merged, names = merge(project, "arm", "arm 1", copy, time)
    shape = merged.shape("arm")
    assert closed(shape.mesh)
    assert len(shape.skeleton) == 5
    # The graft's far half has not moved: each old vertex coincides with a new one.
    now = surface(merged, "arm", time)
    tip = seen[project.shape(copy).mesh.vertices[:, 0] > 1.5]
    apart = np.linalg.norm(tip[:, None] - now[None], axis=2).min(1)
    assert apart.max() < 1e-6
    host = arm.shape("arm").mesh.vertices
    far = surface(project, "arm", time)[np.abs(host[:, 0] - 2.0) > 1.2]
    assert np.linalg.norm(far[:, None] - now[None], axis=2).min(1).max() < 1e-6
    np.testing.assert_allclose(shape.skin.weights.sum(1), 1, atol=1e-6)
    assert surface(merged, "arm", 1.0 - time).shape == now.shape
    assert set(names.values()) <= set(shape.skeleton.names)


def test_weights_and_places_away_from_the_seam_stay_to_the_bit(arm):
    project, copy = copy_character(arm, "arm")
    project = turn_bone(project, copy, 0, about_z(90), 0.0)
    merged, _ = merge(project, "arm", "arm 1", copy, 0.0)
    old, new = arm.shape("arm"), merged.shape("arm")
    index_of = {tuple(v): i for i, v in enumerate(new.mesh.vertices)}
    away = np.flatnonzero(np.abs(old.mesh.vertices[:, 0] - 2.0) > 1.3)
    assert len(away) > 50
    for i in away:
        k = index_of[tuple(old.mesh.vertices[i])]
        np.testing.assert_array_equal(new.skin.weights[k], old.skin.weights[i])
        np.testing.assert_array_equal(new.skin.indices[k], old.skin.indices[i])


def test_a_union_that_cannot_be_made_is_refused_and_changes_nothing(arm):
    project, copy = copy_character(arm, "arm")
    shape = project.shape(copy)
    torn = Mesh(shape.mesh.vertices, shape.mesh.faces[::2], "torn")
    project = project.with_characters(shape.with_changes(mesh=torn))
    before = project
    with pytest.raises(InputError, match=r"the union of the two meshes failed.*torn"):
        merge(project, "arm", "arm 2", copy, 0.0)
    assert are_identical(project, before)
    notes = []
    merged, _ = merge(project, "arm", "arm 2", copy, 0.0, loose=True, notes=notes)
    assert "separate shells" in notes[0]
    assert len(merged.shape("arm").mesh.vertices) == 2 * len(torn.vertices)


def test_a_cut_where_no_mesh_is_around_the_bone_is_refused(arm):
    shape = arm.shape("arm")
    away = Mesh(shape.mesh.vertices + np.array([0, 9, 0]), shape.mesh.faces)
    with pytest.raises(InputError, match="surrounds"):
        cut_bone(arm.with_characters(shape.with_changes(mesh=away)), "arm", 2, 0.5, 0.0)


def test_a_shape_without_a_mesh_is_merged_with_one_that_has_one(arm):
    bare, copy = copy_character(arm, "arm")
    bare = bare.with_characters(bare.shape(copy).with_changes(mesh=None, skin=None))
    onto, _ = merge(bare, "arm", "arm 2", copy, 0.5)
    assert are_identical(onto.shape("arm").mesh, arm.shape("arm").mesh)
    under, _ = merge(bare, copy, "arm 2", "arm", 0.5)
    np.testing.assert_array_equal(under.shape(copy).skin.weights, arm.shape("arm").skin.weights)
    assert len(under.shape(copy).mesh.vertices) == len(arm.shape("arm").mesh.vertices)


def test_a_moving_root_with_skin_stays_as_a_bone_without_length(arm):
    project, copy = copy_character(arm, "arm")
    shape = project.shape(copy)
    layer = shape.spans[1][0].refs[0].layer
    spans = ((Span(1.0, (Ref(layer, 0.0, 1.0),)),), *shape.spans[1:])
    skin = shape.skin
    indices = np.where(shape.mesh.vertices[:, :1] < 1.0, 0, skin.indices).astype(np.uint16)
    weights = np.where(shape.mesh.vertices[:, :1] < 1.0, [1, 0, 0, 0], skin.weights).astype(np.float32)
    moved = shape.with_changes(spans=spans, skin=type(skin)(indices, weights))
    project = project.with_characters(moved)
    time = 0.5
    seen = surface(project, copy, time)
    seen = seen - evaluate_pose(project, copy, time).joints[0] + evaluate_pose(project, "arm", time).joints[2]
    merged, _ = merge(project, "arm", "arm 2", copy, time)
    assert len(merged.shape("arm").skeleton) == 6
    now = surface(merged, "arm", time)
    base = (shape.mesh.vertices[:, 0] > 0.6) & (shape.mesh.vertices[:, 0] < 0.9)
    apart = np.linalg.norm(seen[base][:, None] - now[None], axis=2).min(1)
    assert apart.max() < 1e-6


@pytest.fixture(scope="module")
def fork(arm):
    """Returns the arm with two more arms at its end, one on each side."""
    project = arm
    for degrees in (50, -50):
        project, copy = copy_character(project, "arm" if degrees > 0 else "copied")
        if degrees > 0:
            kept = project.shape(copy).with_changes(id="copied")
            project = project.drop_character(copy).with_characters(kept)
            project, copy = copy_character(project, "copied")
        project = turn_bone(project, copy, 0, about_z(degrees))
        project, _ = merge(project, "arm", "arm 2", copy)
    return project.drop_character("copied")


@pytest.mark.parametrize("time", [None, 0.0, 0.8])
def test_a_stroke_through_two_limbs_takes_both_off(fork, time):
    joints = compute_pose(fork, fork.shape("arm"), time)[1]
    ends = [joints[fork.shape("arm").skeleton.index(name)] for name in ("arm 1 2", "arm 1 3")]
    start = joints[2]
    normal = (ends[0] + ends[1]) / 2 - start
    plane = PlaneCut((start + (ends[0] + ends[1]) / 2) / 2, normal)
    edited, ids = cut_shape_along_stroke(fork, "arm", plane, time)
    assert len(ids) == 3 and ids[0] == "arm"
    before = compute_pose(fork, fork.shape("arm"), time)
    seen = dict(zip(fork.shape("arm").skeleton.names, before[0], strict=True))
    where = dict(zip(fork.shape("arm").skeleton.names, before[1], strict=True))
    for part in ids:
        shape = edited.shape(part)
        assert closed(shape.mesh)
        for name, turn, place in zip(shape.skeleton.names, *compute_pose(edited, shape, time), strict=True):
            if name in seen:
                assert angle(turn, seen[name]) < 1e-9
                np.testing.assert_allclose(place, where[name], atol=1e-9)
        sides = plane.compute_distances(surface(edited, part, time))
        assert (sides < 0.15).all() if part == "arm" else (sides > -0.15).all()
    total = sum(volume(edited.shape(i).mesh.vertices, edited.shape(i).mesh.faces) for i in ids)
    whole = fork.shape("arm").mesh
    assert total == pytest.approx(volume(whole.vertices, whole.faces), rel=1e-9)


def test_a_stroke_without_a_mesh_cuts_the_bones(fork):
    bare = fork.with_characters(fork.shape("arm").with_changes(mesh=None, skin=None))
    joints = compute_pose(bare, bare.shape("arm"), 0.3)[1]
    edited, ids = cut_shape_along_stroke(
        bare, "arm", PlaneCut((joints[0] + joints[1]) / 2, joints[1] - joints[0]), 0.3
    )
    assert [len(edited.shape(i).skeleton) for i in ids] == [2, len(joints)]


def test_ambiguous_stroke_is_refused(fork):
    joints = compute_pose(fork, fork.shape("arm"), 0.0)[1]
    along = joints[1] - joints[0]
    refused = [
        (PlaneCut(joints[0] - 9 * along, along), "crosses no bone"),
        (PlaneCut((joints[0] + joints[1]) / 2 + [0, 3, 0], along, reach=0.5), "crosses no bone"),
    ]
    for plane, words in refused:
        with pytest.raises(InputError, match=words):
            cut_shape_along_stroke(fork, "arm", plane, 0.0)
    picture = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    twice = StrokeCut(np.array([[0.5, -1.0], [0.5, 1.0], [1.5, 1.0], [1.5, -1.0]]), picture)
    with pytest.raises(InputError, match="crosses"):
        cut_shape_along_stroke(fork, "arm", twice, None)
    across = PlaneCut((joints[0] + joints[1]) / 2, along)
    bent = set_bone(fork, "arm", 2, about_z(180), 0.0)
    with pytest.raises(InputError, match="and, below, at bone"):
        cut_shape_along_stroke(bent, "arm", across, 0.0)
