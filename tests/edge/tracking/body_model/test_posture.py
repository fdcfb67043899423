"""Tests of the compiled forward kinematics against plain sums."""

from __future__ import annotations

import numpy as np
import pytest

from enliven.rotation import from_matrix, from_rotation_vector, to_matrix, to_rotation_vector
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, forward, predict_next, rotation


def random_posture(seed: int, turns: float = 0.8) -> Posture:
    """Returns a person with random limb rotations and random proportions."""
    random = np.random.default_rng(seed)
    rotations = standing_pose() @ to_matrix(from_rotation_vector(random.normal(0, turns, (13, 3))))
    lengths = model.lengths_for_height(1.7) * random.uniform(0.8, 1.2, len(model.LENGTHS))
    return Posture(random.normal(0, 2, 3), rotations, lengths)


def places(posture: Posture, frames, offsets) -> np.ndarray:
    """Returns (N, 3) positions of the (N, 3, 12) offsets in the (N,) frames."""
    world, pivots = forward(posture.position, posture.rotations, posture.lengths)
    return pivots[frames] + np.einsum("nab,nb->na", world[frames], offsets @ posture.lengths)


@pytest.mark.parametrize("seed", range(20))
def test_joints_and_capsules_are_carried_by_their_frames(seed):
    posture, shape = random_posture(seed), model.CAPSULES
    joints = places(posture, model.JOINT_FRAMES, model.JOINT_OFFSETS)
    np.testing.assert_allclose(posture.joints(), joints, atol=1e-12)
    ends, radii = posture.capsules()
    for end in (0, 1):
        np.testing.assert_allclose(ends[:, end], places(posture, shape.frame, shape.ends[:, end]), atol=1e-12)
    np.testing.assert_allclose(radii, shape.radii * posture.lengths[model.GIRTH], atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_capsules_follow_a_posture_that_is_written_into(seed):
    """Capsules are cached. The cache becomes invalid as soon as a value has changed."""
    posture, other = random_posture(seed), random_posture(seed + 100)
    for name in ("position", "rotations", "lengths"):
        before = posture.capsules()
        assert posture.capsules() is before
        getattr(posture, name)[:] = getattr(other, name)
        for actual, expected in zip(posture.capsules(), posture.copy().capsules(), strict=True):
            np.testing.assert_array_equal(actual, expected)
        assert any((a != b).any() for a, b in zip(before, posture.capsules(), strict=True))
    posture.position = posture.position + 1.0
    np.testing.assert_allclose(posture.capsules()[0], other.capsules()[0] + 1.0, atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_orientations_are_those_of_the_bones_frames(seed):
    posture = random_posture(seed)
    world, _ = forward(posture.position, posture.rotations, posture.lengths)
    expected = from_matrix(world[model.BONE_FRAMES])
    np.testing.assert_allclose(posture.orientations(), expected, atol=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_a_rotation_turns_about_x_then_y_then_z(seed):
    angles = np.random.default_rng(seed).uniform(-4, 4, 3)
    x, y, z = (
        to_matrix(from_rotation_vector(angle * axis)) for angle, axis in zip(angles, np.eye(3), strict=True)
    )
    np.testing.assert_allclose(rotation(*angles), z @ y @ x, atol=1e-12)
    np.testing.assert_array_equal(rotation(), np.eye(3))


@pytest.mark.parametrize("seed", range(20))
def test_predicted_motion_is_damped_and_limited(seed):
    """The prediction is four fifths of the last frame's motion, limited to 0.1 metres and 0.25 radians."""
    before, random = random_posture(seed), np.random.default_rng(seed)
    now, turns = before.copy(), random.normal(0, 0.2, (13, 3))
    now.position += random.normal(0, 0.08, 3)
    now.rotations = before.rotations @ to_matrix(from_rotation_vector(turns))
    predicted = predict_next(before, now)
    step = 0.8 * (now.position - before.position)
    step *= min(1.0, 0.1 / np.linalg.norm(step))
    np.testing.assert_allclose(predicted.position, now.position + step, atol=1e-12)
    angles = np.linalg.norm(turns, axis=1, keepdims=True)
    on = 0.8 * turns * np.minimum(1.0, 0.25 / (0.8 * angles))
    between = now.rotations.transpose(0, 2, 1) @ predicted.rotations
    np.testing.assert_allclose(to_rotation_vector(from_matrix(between)), on, atol=1e-9)
