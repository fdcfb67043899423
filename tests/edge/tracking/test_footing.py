"""Feet on the floor, and limbs that may be what the camera took for something else."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven_edge.tracking import model, ranges, terms
from enliven_edge.tracking.gauss_newton import stepped
from enliven_edge.tracking.observation import nearest_columns
from enliven_edge.tracking.posture import Posture, forward

TURNS = (model.DOF_FRAME, model.DOF_AXIS)
CAMERA = np.array([150.0, 150.0, 80.0, 60.0])
POSE = np.array([[1.0, 0, 0, 0], [0, -1.0, 0, 1.0], [0, 0, -1.0, 0], [0, 0, 0, 1]])
"""A level sensor a metre above the floor that looks along -Z."""
FEET = np.isin(model.CAPSULES.frame, (model.FOOT_L, model.FOOT_R))


def standing_at(height: float, seed: int = 0, spread: float = 0.0) -> Posture:
    """Somebody at 2.5 m whose hip centre is so high, limbs turned at random."""
    random = np.random.default_rng(seed)
    posture = Posture(np.array([0.0, height, -2.5]), ranges.standing(), model.lengths_for_height(1.7))
    step = np.zeros(42)
    step[3 : model.DOFS] = random.normal(0, spread, model.DOFS - 3) if spread else 0.0
    return Posture(*stepped(posture.position, posture.rotations, posture.lengths, step, *TURNS))


def surroundings(posture: Posture):
    world, pivots, by_length = forward(posture.position, posture.rotations, posture.lengths)
    body = (world, pivots, by_length, model.MOVES, *TURNS, model.CAPSULE_UNKNOWNS, model.FRAME_PARENTS)
    return *posture.capsules(), model.CAPSULES.frame, model.CAPSULES.ends, body


def lowest(posture: Posture) -> float:
    ends, radii = posture.capsules()
    return float((ends[FEET][:, :, 1] - radii[FEET]).min())


def stood(posture: Posture):
    gradient = np.zeros(42)
    return terms.on_the_floor(np.zeros((42, 42)), gradient, *surroundings(posture), 1.0), gradient


@given(st.integers(0, 10_000), st.floats(0.9, 1.3))
@settings(max_examples=40, deadline=None)
def test_the_lower_foot_costs_its_height_and_no_more_the_higher_it_is(seed, height):
    posture = standing_at(height, seed, 0.2)
    energy, gradient = stood(posture)
    above = max(lowest(posture), 0.0)
    assert energy == pytest.approx(above**2 / (1 + (above / 0.1) ** 2), abs=1e-12)
    assert (above == 0.0) == (not gradient.any())
    assert energy <= 0.1**2


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_gradient_of_standing_is_the_weighted_residual(seed):
    """Iterated least squares: the gradient is w^2 h dh/du, half the energy's slope of Geman-McClure."""
    posture = standing_at(1.0, seed, 0.2)
    direction = np.random.default_rng(seed).normal(size=42) * np.where(np.arange(42) < model.DOFS, 1.0, 0.05)
    energies = []
    for h in (-1e-6, 1e-6):
        moved = stepped(posture.position, posture.rotations, posture.lengths, h * direction, *TURNS)
        energies.append(stood(Posture(*moved))[0])
    assert 2 * stood(posture)[1] @ direction == pytest.approx(
        (energies[1] - energies[0]) / 2e-6, rel=0.02, abs=1e-6
    )


def seen_through(posture: Posture, behind_front: float, feet: float) -> np.ndarray:
    """(C,) the share of each capsule that was seen through, where nothing of it is the person's pixels.

    The camera sees a wall this far behind the front of whatever it looks at.
    """
    ends, radii = posture.capsules()
    away = -(ends[:, :, 2].mean() + radii.mean() * 0)
    mask = np.zeros((120, 160), bool)
    mask[0, 0] = True
    depth = np.full((120, 160), away - radii.mean() + behind_front)
    violated = np.zeros(len(ends))
    view = (depth, mask, nearest_columns(mask), CAMERA, POSE)
    terms.free_space(
        np.zeros((42, 42)), np.zeros(42), *surroundings(posture), view, 1.0, 0.25, 5, violated, feet
    )
    return violated


def test_a_limb_may_be_what_is_seen_where_it_is_but_not_before_a_far_wall():
    posture = standing_at(0.95)
    arms = np.isin(model.CAPSULES.frame, (model.FOREARM_L, model.FOREARM_R))
    assert (seen_through(posture, 0.6, terms.THICK)[arms] == 1.0).all()
    assert (seen_through(posture, 0.0, terms.THICK)[arms] == 0.0).all()


def test_a_foot_is_seen_through_where_the_floor_is_when_feet_are_to_point():
    posture = standing_at(0.95)
    assert seen_through(posture, 0.02, -0.05)[FEET].sum() > 0
    assert (
        seen_through(posture, 0.02, terms.THICK)[FEET].sum() < seen_through(posture, 0.02, -0.05)[FEET].sum()
    )
