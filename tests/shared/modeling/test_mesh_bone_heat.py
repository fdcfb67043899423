"""Tests of bone heat: bounded, a partition of unity, symmetric, local to each bone, without hidden bones."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mesh_makers import ball, flat_shaded, line, partition_of_unity, tube

from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh
from enliven.modeling.skinning.heat_diffusion import (
    bone_heat,
    bone_segments,
    compute_outward_normals,
    cotangent_laplacian,
    heat_weights,
)
from enliven.modeling.skinning.skin_values import keep_largest_weights, make_dense_weights
from enliven.modeling.skinning.skins import renumber_bones
from enliven.modeling.skinning.visibility import find_nearest_seen


def both(one, other):
    faces = np.concatenate([one.faces, other.faces + len(one.vertices)])
    return Mesh(np.concatenate([one.vertices, other.vertices]), faces)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), joints=st.integers(1, 12), flat=st.booleans(), heat=st.floats(0.1, 10))
def test_weights_are_bounded_and_sum_to_one_for_any_bones(seed, joints, flat, heat):
    """Bones anywhere, inside, outside and of no length; needles and faces without area in the mesh."""
    rng = np.random.default_rng(seed)
    mesh = ball(0.3, detail=2)
    vertices = mesh.vertices * rng.uniform(0.01, 1.0, 3)
    faces = np.concatenate([mesh.faces, [[0, 0, 1], [2, 3, 2]]]).astype(np.int32)
    mesh = Mesh(vertices, faces)
    if flat:
        mesh = flat_shaded(mesh)
    parents = np.array([-1, *(rng.integers(0, j) for j in range(1, joints))])
    places = rng.normal(size=(joints, 3)) * rng.choice([0.0, 0.1, 0.5], (joints, 1))
    skeleton = Skeleton(tuple(map(str, range(joints))), parents, places)
    skin = bone_heat(mesh, skeleton)
    assert partition_of_unity(skin) and skin.indices.max() < joints
    segments, owners = bone_segments(skeleton)
    whole = heat_weights(mesh, segments, owners, joints)
    assert whole.min() >= 0 and whole.max() <= 1
    np.testing.assert_allclose(whole.sum(1), 1, atol=1e-6)
    # One place, one weight.
    order = np.lexsort(mesh.vertices.T)
    same = (np.diff(mesh.vertices[order], axis=0) == 0).all(1)
    assert (skin.weights[order[1:][same]] == skin.weights[order[:-1][same]]).all()


def test_a_symmetric_shape_has_symmetric_weights():
    mesh = tube(0.2, 2.0, 16, 0.1)
    skeleton = Skeleton(
        ("middle", "up", "tip", "down", "toe"),
        np.array([-1, 0, 1, 0, 3]),
        np.array([[0, 0, 1.0], [0, 0, 1.4], [0, 0, 1.9], [0, 0, 0.6], [0, 0, 0.1]]),
    )
    # The tube's triangles are not mirror-symmetric, but they are symmetric under a half turn about x.
    turned = Mesh(mesh.vertices * [1, -1, -1] + [0, 0, 2], mesh.faces)
    weights = make_dense_weights(bone_heat(mesh, skeleton), 5)
    other = make_dense_weights(bone_heat(turned, skeleton), 5)[:, [0, 3, 4, 1, 2]]
    np.testing.assert_allclose(weights, other, atol=1e-5)


def test_a_vertex_on_the_middle_of_a_bone_belongs_to_it():
    mesh, skeleton = tube(0.1, 2.0, 16, 0.05), line([[0, 0, 0], [0, 0, 1.0], [0, 0, 2.0]])
    weights = make_dense_weights(bone_heat(mesh, skeleton), 3)
    for bone, z in ((1, 0.5), (2, 1.5)):
        ring = np.abs(mesh.vertices[:, 2] - z) < 1e-9
        assert ring.sum() == 16 and weights[ring, bone].min() > 0.95
    ring = np.abs(mesh.vertices[:, 2] - 1.0) < 1e-9
    np.testing.assert_allclose(weights[ring, 1], 0.5, atol=0.05)
    # The weight decreases monotonically from one vertex to the next.
    along = np.argsort(mesh.vertices[:-2, 2], kind="stable").reshape(-1, 16)
    assert (np.diff(weights[along, 1].mean(1)) <= 1e-6).all()


def test_a_bone_behind_another_limb_gives_no_heat():
    """Two parallel limbs have slanted bones. Each outer side is nearest to its own limb's bone."""
    left, right = tube(0.1, 1.0, 16, 0.05), tube(0.1, 1.0, 16, 0.05)
    mesh = both(left, Mesh(right.vertices + np.array([0.25, 0, 0]), right.faces))
    # The right limb's bone is in its far half, so the left bone is nearer to its near side.
    skeleton = Skeleton(
        ("root", "left", "to", "right"),
        np.array([-1, 0, 0, 2]),
        np.array([[0.08, 0, 0.0], [0.08, 0, 1.0], [0.32, 0, 0.0], [0.32, 0, 1.0]]),
    )
    weights = make_dense_weights(bone_heat(mesh, skeleton), 4)
    middle = np.abs(mesh.vertices[:, 2] - 0.5) < 0.2
    on_right = mesh.vertices[:, 0] > 0.125
    assert weights[middle & on_right, 1].max() < 0.01 and weights[middle & on_right, 3].min() > 0.8
    assert weights[middle & ~on_right, 3].max() < 0.01 and weights[middle & ~on_right, 1].min() > 0.8


def test_a_part_that_sees_no_bone_follows_the_nearest():
    shell = ball(0.3, detail=3)
    inner = Mesh(ball(0.1, detail=2).vertices, ball(detail=2).faces[:, ::-1])
    skeleton = line([[0.5, 0, 0], [0.9, 0, 0], [1.4, 0, 0]])
    weights = make_dense_weights(bone_heat(both(shell, inner), skeleton), 3)
    assert weights[len(shell.vertices) :, 1].min() > 0.9


def test_sight_agrees_with_trying_every_face():
    rng = np.random.default_rng(5)
    mesh = both(ball(0.3, detail=2), ball(0.2, (0.45, 0, 0), detail=2))
    normals = compute_outward_normals(mesh)
    segments = rng.uniform(-0.4, 0.7, (7, 2, 3))
    chosen, distance = find_nearest_seen(mesh.vertices, normals, mesh.faces, segments, 1e-9)
    vectors = segments[:, 1] - segments[:, 0]
    for v in rng.integers(0, len(mesh.vertices), 60):
        p = mesh.vertices[v]
        u = np.clip(((p - segments[:, 0]) * vectors).sum(1) / (vectors**2).sum(1), 0, 1)
        ways = segments[:, 0] + u[:, None] * vectors - p
        far = np.linalg.norm(ways, axis=1)
        inward = ways @ normals[v] <= 0.2 * far
        seen = [s for s in np.argsort(far)[:6] if inward[s] and not hidden(mesh, v, p + ways[s])]
        assert (chosen[v, 0] == seen[0]) if seen else (chosen[v, 0] == -1)
        best = far[seen[0]] if seen else np.inf
        assert distance[v] == pytest.approx(best * (best / far.min()) ** 4)


def test_normals_look_outward_also_of_a_mesh_that_is_inside_out():
    mesh = ball()
    turned = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    np.testing.assert_allclose(compute_outward_normals(mesh), compute_outward_normals(turned), atol=1e-12)
    assert ((compute_outward_normals(mesh) * mesh.vertices).sum(1) > 0).all()


def hidden(mesh, v, target):
    """Returns True if another face lies between a vertex and the target, found by solving for each face."""
    a, b, c = (mesh.vertices[mesh.faces[(mesh.faces != v).all(1)][:, k]] for k in range(3))
    away = np.broadcast_to(mesh.vertices[v] - target, a.shape)
    matrices = np.stack([b - a, c - a, away], 2)
    good = np.abs(np.linalg.det(matrices)) > 1e-15
    s, t, way = np.linalg.solve(matrices[good], (mesh.vertices[v] - a)[good][..., None])[..., 0].T
    return bool(((s >= 0) & (t >= 0) & (s + t <= 1) & (way > 1e-4) & (way < 0.999)).any())


def test_the_laplacian_is_an_m_matrix_whatever_the_triangles():
    rng = np.random.default_rng(2)
    vertices = rng.normal(size=(30, 3)) * [1, 1, 1e-6]
    faces = rng.integers(0, 30, (80, 3)).astype(np.int32)
    laplacian, mass = cotangent_laplacian(vertices, faces)
    full = laplacian.toarray()
    assert np.isfinite(full).all() and mass.min() > 0
    np.testing.assert_allclose(full.sum(1), 0, atol=1e-6 * np.abs(full).max())
    off = full - np.diag(np.diag(full))
    assert off.max() <= 0 and np.allclose(full, full.T)


def test_known_weights_stay_and_others_join_them():
    mesh, skeleton = tube(0.1, 2.0, 16, 0.05), line([[0, 0, 0], [0, 0, 1.0], [0, 0, 2.0]])
    given_weights = np.zeros((len(mesh.vertices), 3))
    given_weights[:, 0] = 1.0
    free = mesh.vertices[:, 2] > 1.0
    weights = heat_weights(mesh, *bone_segments(skeleton), 3, known=given_weights, free=free)
    assert (weights[~free] == given_weights[~free]).all()
    np.testing.assert_allclose(weights.sum(1), 1, atol=1e-6)
    step = np.abs(np.diff(weights[:-2, 0].reshape(-1, 16).mean(1)))
    assert step.max() < 0.6 and weights[mesh.vertices[:, 2] > 1.5, 0].max() < 0.05


def test_a_mesh_without_faces_is_refused():
    with pytest.raises(InputError, match="faces"):
        bone_heat(Mesh(np.zeros((3, 3)), np.zeros((0, 3))), line([[0, 0, 0], [1, 0, 0]]))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 1000), bones=st.integers(1, 9))
def test_four_of_many_and_back(seed, bones):
    rng = np.random.default_rng(seed)
    whole = rng.dirichlet(np.full(bones, 0.3), 20)
    for smooth in (False, True):
        skin = keep_largest_weights(whole, smooth)
        assert partition_of_unity(skin)
        back = make_dense_weights(skin, bones)
        assert ((back > 0).sum(1) <= 4).all()
        if bones <= 4:
            np.testing.assert_allclose(back, whole, atol=1e-6)
    halves = np.arange(bones) // 2
    merged = make_dense_weights(renumber_bones(skin, halves), bones)
    np.testing.assert_allclose(
        merged, np.stack([back[:, halves == k].sum(1) for k in range(bones)], 1), atol=1e-6
    )
