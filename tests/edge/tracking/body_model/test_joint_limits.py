"""Tests of joint limits: possible postures cost nothing, impossible ones do, and left and right are equal."""

from __future__ import annotations

import numpy as np
import pytest

from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.posture import rotation
from enliven_edge.tracking.fit import terms


def cost(rotations, ranges=(joint_limits.MIDDLE, joint_limits.HALF_RANGES)) -> float:
    """Returns the energy of rotations outside the ranges."""
    nothing = np.zeros((42, 42)), np.zeros(42)
    return terms.joint_ranges(*nothing, rotations, *ranges, 1.0, model.DOF_FRAME, model.DOF_AXIS)


def with_thigh(side: int, **turn: float):
    """Returns a standing person with one thigh rotated from hanging; the right one is mirrored."""
    rotations = joint_limits.standing_pose()
    rotations[model.THIGH_L] = rotation(**turn)
    return rotations if side == model.THIGH_L else joint_limits.mirror_rotations(rotations)


SIDES = pytest.mark.parametrize("side", [model.THIGH_L, model.THIGH_R])


@SIDES
@pytest.mark.parametrize(
    "turn",
    [
        {"z": np.deg2rad(85)},
        {"z": np.deg2rad(60), "x": -0.3},
        {"x": -1.9},
        {"x": 0.5},
        {"x": -1.2, "z": 0.7},
        {"z": -0.3},
    ],
    ids=["out to the side", "a side kick", "knee to the chest", "behind", "out and forward", "across"],
)
def test_a_thigh_goes_where_a_dancer_moves_it(side, turn):
    assert cost(with_thigh(side, **turn)) == 0.0


@SIDES
@pytest.mark.parametrize(
    "turn", [{"z": 2.2}, {"z": -1.2}, {"x": 1.5}, {"y": 1.5}], ids=["up", "across", "back", "twisted"]
)
def test_a_thigh_goes_no_farther_than_a_hip_lets_it(side, turn):
    assert cost(with_thigh(side, **turn)) > 0.0


@SIDES
def test_hips_of_a_known_person_bend_as_far_as_when_knees_are_drawn_up(side):
    drawn_up = with_thigh(side, x=-2.3)
    assert cost(drawn_up) > 0.0
    assert cost(drawn_up, joint_limits.WIDE_HIP_LIMITS) == 0.0


@SIDES
@pytest.mark.parametrize(
    "turn",
    [{"x": -2.8}, {"z": 2.2}, {"z": -1.2}, {"x": 1.5}, {"y": 1.5}],
    ids=["through the chest", "up", "across", "back", "twisted"],
)
def test_hips_of_a_known_person_have_limits_too(side, turn):
    assert cost(with_thigh(side, **turn), joint_limits.WIDE_HIP_LIMITS) > 0.0


@pytest.mark.parametrize(
    "ranges", [(joint_limits.MIDDLE, joint_limits.HALF_RANGES), joint_limits.WIDE_HIP_LIMITS]
)
@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_shoulders_do_not_turn_against_the_hips_by_a_right_angle(ranges, way):
    twisted = joint_limits.standing_pose()
    twisted[model.CHEST] = rotation(y=way * 0.7)
    assert cost(twisted, ranges) == 0.0
    twisted[model.CHEST] = rotation(y=way * 1.2)
    assert cost(twisted, ranges) > 0.0


@pytest.mark.parametrize("seed", range(20))
def test_mirrored_posture_has_the_same_cost(seed):
    random = np.random.default_rng(seed)
    turns = random.normal(0, 0.8, (13, 3))
    posture = np.stack([rotation(x=x, y=y, z=z) for x, y, z in turns])
    assert cost(posture) == pytest.approx(cost(joint_limits.mirror_rotations(posture)))


def test_standing_posture_has_zero_cost():
    assert cost(joint_limits.RELAXED) == 0.0


def test_a_weight_by_frame_is_the_usual_one_but_where_another_is_given():
    weights = model.frame_weights(1.5, {model.PELVIS: 0.0, model.FOOT_R: 3.0})
    np.testing.assert_array_equal(weights, [0.0, *[1.5] * 11, 3.0])
