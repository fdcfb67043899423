"""Tests of the skinning kernels against eq. 2 in NumPy, and of invariants of skinning for random
characters.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.isosurface import surface_of
from skinned_normals import skin_normals

from enliven import rotation
from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.deformation.skinning import skin_vertices
from enliven.document.character import Character, Pose, SkinWeights
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh


@pytest.fixture
def character():
    rng = np.random.default_rng(0)
    weights = rng.random((50, 4))
    weights /= weights.sum(1, keepdims=True)
    return Character(
        "c",
        rng.normal(size=(50, 3)).astype(np.float32),
        rng.integers(0, 50, (30, 3)).astype(np.int32),
        SkinWeights(rng.integers(0, 7, (50, 4)).astype(np.uint16), weights.astype(np.float32)),
        rng.normal(size=(7, 3)).astype(np.float32),
        np.empty((0, 2), np.int32),
    )


def random_pose(seed):
    rng = np.random.default_rng(seed)
    return Pose(
        "c", 0, rng.normal(size=(7, 3, 3)).astype(np.float32), rng.normal(size=(7, 3)).astype(np.float32)
    )


@pytest.mark.parametrize("seed", range(3))
def test_vertices_follow_eq_2(character, seed):
    pose = random_pose(seed)
    nodes, weights = character.skin.indices, character.skin.weights
    arms = character.vertices[:, None] - character.pivots[nodes]
    each = np.einsum("vkab,vkb->vka", pose.linear[nodes], arms) + pose.positions[nodes]
    expected = (each * weights[..., None]).sum(1)
    np.testing.assert_allclose(skin_vertices(character, pose), expected, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_normals_follow_the_inverse_transpose(character, seed):
    pose = random_pose(seed)
    nodes, weights = character.skin.indices, character.skin.weights
    normals = np.random.default_rng(9).normal(size=(50, 3)).astype(np.float32)
    blended = np.einsum("vk,vkab->vab", weights.astype(float), pose.linear[nodes].astype(float))
    expected = np.einsum("vba,vb->va", np.linalg.inv(blended), normals) * np.linalg.det(blended)[:, None]
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(skin_normals(character, pose, normals), expected, atol=5e-3)


def test_the_rest_pose_moves_nothing_and_a_turn_turns_all(character):
    np.testing.assert_allclose(skin_vertices(character, character.rest_pose()), character.vertices, atol=1e-5)
    q = rotation.from_rotation_vector([0.4, -1.0, 0.3])
    linear = np.tile(rotation.to_matrix(q), (7, 1, 1)).astype(np.float32)
    pose = Pose("c", 0, linear, rotation.rotate(q, character.pivots).astype(np.float32))
    np.testing.assert_allclose(
        skin_vertices(character, pose), rotation.rotate(q, character.vertices), atol=1e-5
    )
    normals = np.tile(np.array([0, 0, 1], np.float32), (50, 1))
    turned = skin_normals(character, pose, normals)
    np.testing.assert_allclose(turned, np.tile(rotation.rotate(q, [0, 0, 1]), (50, 1)), atol=1e-6)


def test_a_collapsed_map_gives_no_nan(character):
    pose = Pose("c", 0, np.zeros((7, 3, 3), np.float32), np.zeros((7, 3), np.float32))
    assert np.isfinite(skin_normals(character, pose, np.ones((50, 3), np.float32))).all()


def random_character(rng, count=40, nodes=9):
    """Returns a character with random weights, some of which are zero. Some vertices follow only one node."""
    weights = rng.random((count, 4)) * (rng.random((count, 4)) < 0.7)
    weights[weights.sum(1) == 0, 0] = 1
    weights /= weights.sum(1, keepdims=True)
    return Character(
        "r",
        (3 * rng.normal(size=(count, 3))).astype(np.float32),
        rng.integers(0, count, (20, 3)).astype(np.int32),
        SkinWeights(rng.integers(0, nodes, (count, 4)).astype(np.uint16), weights.astype(np.float32)),
        rng.normal(size=(nodes, 3)).astype(np.float32),
        np.empty((0, 2), np.int32),
    )


def moved(character, turn, shift):
    """Returns the pose in which every node has the same rigid motion."""
    count = len(character.pivots)
    linear = np.tile(turn, (count, 1, 1)).astype(np.float32)
    return Pose("r", 0, linear, (character.pivots @ turn.T + shift).astype(np.float32))


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_a_rigid_motion_of_all_nodes_moves_everything_rigidly(seed):
    rng = np.random.default_rng(seed)
    character = random_character(rng)
    turn, shift = (
        rotation.to_matrix(rotation.from_rotation_vector(2 * rng.normal(size=3))),
        rng.normal(size=3),
    )
    pose = moved(character, turn, shift)
    np.testing.assert_allclose(skin_vertices(character, pose), character.vertices @ turn.T + shift, atol=2e-5)
    normals = rng.normal(size=character.vertices.shape).astype(np.float32)
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    np.testing.assert_allclose(skin_normals(character, pose, normals), unit @ turn.T, atol=5e-6)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_the_rest_pose_is_exact_where_weights_are_dyadic(seed):
    """Quarters and halves add up without rounding, so not a bit may change."""
    rng = np.random.default_rng(seed)
    character = random_character(rng)
    dyadic = np.array([[1, 0, 0, 0], [0.5, 0.5, 0, 0], [0.25] * 4, [0.5, 0.25, 0.25, 0]], np.float32)
    skin = SkinWeights(character.skin.indices, dyadic[rng.integers(0, 4, len(character.vertices))])
    vertices = np.round(character.vertices * 1024) / 1024
    exact = Character(
        "r", vertices.astype(np.float32), character.faces, skin, character.pivots, character.edges
    )
    np.testing.assert_array_equal(skin_vertices(exact, exact.rest_pose()), exact.vertices)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_moves_add_up(seed):
    """Eq. 2 is linear in the transforms: half of one pose and half of another give the mean of both."""
    rng = np.random.default_rng(seed)
    character = random_character(rng)
    first, second = (
        Pose(
            "r", 0, rng.normal(size=(9, 3, 3)).astype(np.float32), rng.normal(size=(9, 3)).astype(np.float32)
        )
        for _ in range(2)
    )
    both = Pose("r", 0, (first.linear + second.linear) / 2, (first.positions + second.positions) / 2)
    mean = (skin_vertices(character, first) + skin_vertices(character, second)) / 2
    np.testing.assert_allclose(skin_vertices(character, both), mean, atol=1e-4)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_normals_stay_orthogonal_to_tangents(seed):
    rng = np.random.default_rng(seed)
    character = random_character(rng)
    linear = np.eye(3) + 0.3 * rng.normal(size=(9, 3, 3))
    pose = Pose("r", 0, linear.astype(np.float32), rng.normal(size=(9, 3)).astype(np.float32))
    normals = rng.normal(size=character.vertices.shape)
    tangents = np.cross(normals, rng.normal(size=normals.shape))
    blended = np.einsum("vk,vkab->vab", character.skin.weights, pose.linear[character.skin.indices])
    turned = np.einsum("vab,vb->va", blended.astype(float), tangents)
    after = skin_normals(character, pose, normals.astype(np.float32))
    turned /= np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-3)
    clear = np.abs(np.linalg.det(blended.astype(float))) > 0.05
    np.testing.assert_allclose((after * turned).sum(1)[clear], 0, atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(after, axis=1)[clear], 1, atol=1e-5)


def test_normals_of_a_bent_graph_are_nearly_those_of_the_bent_surface():
    """Compares normals on a capsule whose upper half is bent by 45 degrees."""

    def field(points):
        up = np.clip(points[:, 1], 0.15, 0.85)
        return np.linalg.norm(points - np.stack([0 * up, up, 0 * up], 1), axis=1) - 0.1

    mesh = Mesh(*surface_of(field, np.array([-0.2, -0.1, -0.2]), np.array([0.2, 1.1, 0.2]), 0.025), "capsule")
    graph = DeformationGraph.build(mesh, 60)
    character = character_from_graph(mesh, graph, "capsule")
    y, bend = graph.positions[:, 1], np.pi / 4 / 0.6
    angle = bend * np.clip(y - 0.2, 0, 0.6)
    linear = rotation.to_matrix(rotation.from_rotation_vector(angle[:, None] * np.array([0.0, 0, 1])))
    # The spine is a circular arc from 0.2 to 0.8, and straight before and after it.
    before, after = np.minimum(y, 0.2), np.maximum(y - 0.8, 0)
    spine = np.stack([(np.cos(angle) - 1) / bend, before + np.sin(angle) / bend, 0 * y], 1)
    spine += after[:, None] * np.stack([-np.sin(angle), np.cos(angle), 0 * y], 1)
    positions = np.einsum("jab,jb->ja", linear, graph.positions * [1, 0, 1]) + spine
    pose = Pose("capsule", 0, linear.astype(np.float32), positions.astype(np.float32))
    bent = Mesh(skin_vertices(character, pose).astype(float), mesh.faces).vertex_normals()
    normals = skin_normals(character, pose, mesh.vertex_normals().astype(np.float32))
    assert np.quantile((bent * normals).sum(1), 0.02) > 0.9


def test_mismatched_shapes_are_refused_and_out_is_used(character):
    pose = random_pose(0)
    out = np.empty((50, 3), np.float32)
    assert skin_vertices(character, pose, out) is out
    np.testing.assert_array_equal(out, skin_vertices(character, pose))
    short = Pose("c", 0, pose.linear[:3], pose.positions[:3])
    for call in (
        lambda: skin_vertices(character, short),
        lambda: skin_normals(character, short, np.ones((50, 3), np.float32)),
        lambda: skin_vertices(character, pose, np.empty((49, 3), np.float32)),
        lambda: skin_vertices(character, pose, np.empty((50, 3))),
    ):
        with pytest.raises(InputError):
            call()
