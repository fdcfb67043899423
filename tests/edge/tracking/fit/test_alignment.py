"""Tests of alignment: a posture is recovered from its joint positions, from any nearby initial posture."""

from __future__ import annotations

import numpy as np
import pytest
from tolerances import SOLVER_TOLERANCE, assert_alike

from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.kinematics import turn
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect.hypotheses import BANK
from enliven_edge.tracking.fit.alignment import (
    POSTURE_LIMITS,
    REST_WEIGHTS,
    SKELETON,
    align,
    write_normal_equations,
)

LENGTHS = model.lengths_for_height(1.7)
ANCHORS = (model.JOINT_FRAMES, model.JOINT_OFFSETS)
ALIKE = np.full(20, 0.03)


def standing(yaw: float = 0.0) -> Posture:
    return Posture(np.array([0.0, 0.9, 0.0]), joint_limits.standing_pose(yaw), LENGTHS.copy())


@pytest.mark.parametrize("number", range(len(BANK)))
def test_every_posture_of_the_bank_is_reached_from_standing(number):
    wanted = Posture(np.array([0.3, 0.6, -2.0]), BANK[number].copy(), LENGTHS.copy())
    aligned, _ = align(standing(), *ANCHORS, wanted.joints(), ALIKE, width=1.0, iterations=60)
    assert np.linalg.norm(aligned.joints() - wanted.joints(), axis=1).mean() < 0.04


def test_outlier_is_downweighted():
    wanted = standing(0.4)
    targets = wanted.joints()
    targets[7] += [0.0, 1.5, 0.0]
    aligned, _ = align(standing(), *ANCHORS, targets, ALIKE)
    assert np.linalg.norm(aligned.joints() - wanted.joints(), axis=1).max() < 0.1


def test_target_without_weight_has_no_effect():
    targets = standing(0.4).joints()
    strayed, weights = targets.copy(), ALIKE.copy()
    strayed[7] += 0.15
    weights[7] = 0.0
    aligned, energy = align(standing(), *ANCHORS, targets, weights)
    other, same = align(standing(), *ANCHORS, strayed, weights)
    assert_alike(aligned.joints(), other.joints(), SOLVER_TOLERANCE)
    assert energy == same


def test_start_posture_is_not_modified():
    start = standing()
    align(start, *ANCHORS, standing(0.4).joints(), ALIKE)
    np.testing.assert_array_equal(start.joints(), standing().joints())


def test_the_gradient_is_that_of_the_energy():
    dice = np.random.default_rng(0)
    posture = Posture(np.array([0.1, 0.8, -2.0]), BANK[0].copy(), LENGTHS.copy())
    wanted = (*ANCHORS, posture.joints() + dice.normal(0, 0.08, (20, 3)), ALIKE)

    def energy(step: np.ndarray, gradient: np.ndarray) -> float:
        rotations = posture.rotations.copy()
        turn(rotations, step[3:], model.DOF_FRAME, model.DOF_AXIS)
        # The width is too large to reject anything. Only then does iterated least squares have the energy's
        # gradient.
        return write_normal_equations(
            np.zeros((30, 30)), gradient, posture.position + step[:3], rotations, LENGTHS, wanted, 1e3,
            SKELETON, POSTURE_LIMITS,
        )  # fmt: skip

    gradient, unused = np.zeros(30), np.zeros(30)
    energy(np.zeros(30), gradient)
    for k in range(30):
        step = np.zeros(30)
        step[k] = 1e-5
        slope = (energy(step, unused) - energy(-step, unused)) / 2e-5
        # For a large rotation of the joint, the logarithm's derivative is only approximately one.
        free = k < 3 or REST_WEIGHTS[model.DOF_FRAME[k - 3]] == 0.0
        assert 2 * gradient[k] == pytest.approx(slope, rel=0.02 if free else 0.3, abs=6.0), k
