"""Looking ahead joint by joint against the same in whole arrays."""

from __future__ import annotations

import numpy as np
import pytest

from enliven.person.joints import PARENTS
from enliven.rotation import conjugate, from_rotation_vector, multiply, normalized, to_rotation_vector
from enliven_edge.tracking.output.prediction import learn_spin, moved_on, turned_on


def limited(velocity, most):
    return velocity * np.minimum(1.0, most / np.linalg.norm(velocity, axis=1, keepdims=True))


@pytest.mark.parametrize("seed", range(20))
def test_joints_move_on_at_their_speed_and_bones_keep_their_length(seed):
    random = np.random.default_rng(seed)
    joints, speed, seconds = (
        random.normal(size=(20, 3)),
        random.normal(0, 4, (20, 3)),
        random.uniform(0, 0.3, 20),
    )
    slow = joints + seconds[:, None] * limited(speed, 6.0)
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            bone = slow[joint] - slow[parent]
            wanted = np.linalg.norm(joints[joint] - joints[parent])
            slow[joint] = slow[parent] + bone * wanted / np.linalg.norm(bone)
    np.testing.assert_allclose(moved_on(joints, speed, seconds), slow, atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_bones_turn_on_at_their_spin_which_is_learnt_from_frame_to_frame(seed):
    random = np.random.default_rng(seed)
    before, spin = normalized(random.normal(size=(20, 4))), random.normal(0, 8, (20, 3))
    turns = multiply(before, from_rotation_vector(random.normal(0, 1, (20, 3))))
    passed, share, seconds = 0.03, 0.4, random.uniform(0, 0.3, 20)
    step = to_rotation_vector(multiply(conjugate(before), turns))
    learnt = spin + share * (step / passed - spin)
    on = multiply(turns, from_rotation_vector(seconds[:, None] * limited(learnt, 10.0)))
    learn_spin(spin, before, turns, passed, share)
    np.testing.assert_allclose(spin, learnt, atol=1e-9)
    np.testing.assert_allclose(turned_on(turns, spin, seconds), on, atol=1e-9)
