"""Tests that hips may bend farther only if the person is known and low. A search uses the usual range."""

import numpy as np
import pytest
from postures_seen_for_tests import observed

from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.posture import Posture, rotation
from enliven_edge.tracking.fit.fit import Fitter
from enliven_edge.tracking.settings import FitSettings

DRAWN_UP = 2.35
"""Flexion of both thighs in radians, 0.35 beyond the usual range and within the wider one."""


def drawn_up(hips: float) -> Posture:
    """Returns a person with drawn-up knees and the hips at a height in metres."""
    rotations = joint_limits.standing_pose(knee=1.9)
    rotations[model.THIGH_L] = rotation(x=-DRAWN_UP, z=0.06)
    rotations[model.THIGH_R] = joint_limits.mirror_rotations(rotations)[model.THIGH_R]
    return Posture(np.array([0.0, hips, -2.5]), rotations, model.lengths_for_height(1.75))


def energy_from(fitter: Fitter, posture: Posture) -> float:
    return fitter.fit(observed(posture), posture, iterations=0)[1].energy


@pytest.mark.parametrize(("hips", "is_wider"), [(0.2, True), (0.5, True), (0.7, False), (0.95, False)])
def test_drawn_up_knees_are_free_only_for_a_known_low_person(hips, is_wider):
    fitter, posture = Fitter(FitSettings()), drawn_up(hips)
    searched, followed = energy_from(fitter, posture), energy_from(fitter.for_tracked_people, posture)
    if is_wider:
        assert followed < searched - 10.0
    else:
        assert followed == searched


@pytest.mark.slow
def test_the_fit_of_a_known_person_keeps_the_missing_floor():
    fitter, posture = Fitter(FitSettings()), drawn_up(0.05)
    with_floor = energy_from(fitter.for_tracked_people, posture)
    fitter.has_floor = False
    assert energy_from(fitter.for_tracked_people, posture) < with_floor
