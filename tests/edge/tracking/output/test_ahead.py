"""Tests of extrapolating joints one by one, against whole arrays."""

from __future__ import annotations

import numpy as np
import pytest

from enliven.person.joints import PARENTS
from enliven.rotation import conjugate, from_rotation_vector, multiply, normalized, to_rotation_vector
from enliven_edge.tracking.output.prediction import (
    move_for,
    predict_joints,
    predict_rotations,
    rotate_for,
    update_spin,
)


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
    np.testing.assert_allclose(move_for(joints, speed, seconds), slow, atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_bones_turn_on_at_their_spin_which_is_learnt_from_frame_to_frame(seed):
    random = np.random.default_rng(seed)
    before, spin = normalized(random.normal(size=(20, 4))), random.normal(0, 8, (20, 3))
    turns = multiply(before, from_rotation_vector(random.normal(0, 1, (20, 3))))
    passed, share, seconds = 0.03, 0.4, random.uniform(0, 0.3, 20)
    step = to_rotation_vector(multiply(conjugate(before), turns))
    learnt = spin + share * (step / passed - spin)
    on = multiply(turns, from_rotation_vector(seconds[:, None] * limited(learnt, 10.0)))
    update_spin(spin, before, turns, passed, share)
    np.testing.assert_allclose(spin, learnt, atol=1e-9)
    np.testing.assert_allclose(rotate_for(turns, spin, seconds), on, atol=1e-9)


def ahead(velocity, delay, seconds, half):
    square = (velocity**2).sum(1)
    return seconds + delay * square / (square + half**2)


@pytest.mark.parametrize("seed", range(20))
def test_speeds_are_learnt_and_a_delay_is_made_up_for_where_something_moves(seed):
    random = np.random.default_rng(seed)
    before, speed, spin = (
        random.normal(size=(20, 3)),
        random.normal(0, 2, (20, 3)),
        random.normal(0, 4, (20, 3)),
    )
    joints, delay = before + random.normal(0, 0.05, (20, 3)), random.uniform(0, 0.05, 20)
    was = normalized(random.normal(size=(20, 4)))
    turns = multiply(was, from_rotation_vector(random.normal(0, 0.2, (20, 3))))
    passed, seconds = random.uniform(0.01, 0.4), random.uniform(0, 0.2) * (seed % 3 > 0)
    share = 1 / (1 + 1 / (2 * np.pi * 3.0 * passed))
    learnt = speed + share * ((joints - before) / passed - speed)
    slow = move_for(joints, learnt, ahead(learnt, delay, seconds, 0.5))
    np.testing.assert_allclose(
        predict_joints(joints, before, speed, delay, passed, seconds), slow, atol=1e-12
    )
    np.testing.assert_allclose(speed, learnt, atol=1e-12)
    turning = spin.copy()
    update_spin(turning, was, turns, passed, share)
    slow = rotate_for(turns, turning, ahead(turning, delay, seconds, 3.0))
    np.testing.assert_allclose(predict_rotations(turns, was, spin, delay, passed, seconds), slow, atol=1e-12)
    np.testing.assert_allclose(spin, turning, atol=1e-12)


def test_first_frame_is_not_extrapolated():
    random = np.random.default_rng(0)
    joints, speed = random.normal(size=(20, 3)), random.normal(size=(20, 3))
    turns, spin = normalized(random.normal(size=(20, 4))), random.normal(size=(20, 3))
    moved = predict_joints(joints, joints, speed, np.full(20, 0.02), 0.0, 0.1)
    turned = predict_rotations(turns, turns, spin, np.full(20, 0.02), 0.0, 0.1)
    assert not speed.any() and not spin.any()
    np.testing.assert_allclose(moved, joints, atol=1e-12)
    np.testing.assert_allclose(turned, turns, atol=1e-12)
