"""The skinning kernels against eq. 2 in NumPy."""

import numpy as np
import pytest

from enliven import rotation
from enliven.character import Character, Pose, SkinWeights
from enliven.deformation.skinning import skin_normals, skin_vertices


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
