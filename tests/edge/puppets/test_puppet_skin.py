"""Tests that a puppet's collision spheres are close to its surface."""

from __future__ import annotations

import numpy as np
from sample_meshes.cactus_puppet import cactus_project

from enliven.deformation.arap.control_point_surface import PuppetSurface
from enliven.document.character import Pose
from enliven.document.puppet import character_from_puppet
from enliven_edge.physics.playground import skin_to_control_points

PUPPET = cactus_project(0.05).puppet("cactus")
CHARACTER = character_from_puppet(PUPPET)


def skinned(character, pose: Pose) -> np.ndarray:
    matrices = pose.matrices(character.pivots)[character.skin.indices]
    vertices = np.concatenate([character.vertices, np.ones((len(character.vertices), 1))], 1)
    return np.einsum("vk,vkab,vb->va", character.skin.weights, matrices, vertices)


def test_arms_are_nearly_where_they_are_solved_to_be() -> None:
    rough = skin_to_control_points(CHARACTER)
    assert rough.kind == "bones"
    rigid = near = 0.0
    for key in PUPPET.poses[1:5]:
        surface = PuppetSurface(PUPPET.mesh, [p.vertex for p in PUPPET.points], None, PUPPET.surface)
        solved = surface.solve_from_rest(key.places)
        linear = np.tile(np.eye(3, dtype=np.float32), (len(CHARACTER.pivots), 1, 1))
        pose = Pose("cactus", 0, linear, np.vstack([np.zeros(3), key.places]).astype(np.float32))
        rigid += np.linalg.norm(CHARACTER.vertices - solved, axis=1).mean()
        near += np.linalg.norm(skinned(rough, pose) - solved, axis=1).mean()
    assert near < 0.6 * rigid
    at_rest = skinned(rough, CHARACTER.rest_pose())
    np.testing.assert_allclose(at_rest, CHARACTER.vertices, atol=1e-5)


def test_other_characters_stay_unchanged() -> None:
    bones = skin_to_control_points(CHARACTER)
    assert skin_to_control_points(bones) is bones
