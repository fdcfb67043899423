"""Tests that the gradients of the fit's compiled terms equal the energies' derivatives."""

import numpy as np
import pytest
from bodies_for_tests import (
    NO_AFFINITY,
    body_of,
    gathered,
    moved_by,
    nearest,
    random_posture,
    seen_as,
    surface_points,
    surroundings,
)
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.fit import data_term, terms
from enliven_edge.tracking.fit.fit import create_fit_model
from enliven_edge.tracking.fit.structures import BodyState
from enliven_edge.tracking.fit.terms import place_model
from enliven_edge.tracking.frame.observation import ImageView, nearest_columns

PAIRS = create_fit_model().pairs


def depth_energy(posture: Posture, points, normals):
    around = surroundings(posture)
    support = np.zeros(len(model.CAPSULES.frame))
    rest = (1.0, 0.07, 0.04, support)

    def term(sums):
        return data_term.depth_to_model(sums, seen_as(points, normals), NO_AFFINITY, around, *rest)[0]

    return gathered(term, posture)[:2]


def explainers(posture: Posture, points, normals) -> list[int]:
    """Returns the nearest capsule of each point."""
    ends, radii, *_ = surroundings(posture)
    return [nearest(p, n, ends, radii)[0] for p, n in zip(points, normals, strict=True)]


def self_energy(posture: Posture):
    matrix, gradient = np.zeros((42, 42)), np.zeros(42)
    around = (surroundings(posture), body_of(posture))
    return terms.self_intersection(matrix, gradient, *around, PAIRS, 1.0, 3), gradient


def free_space_energy(posture: Posture, view):
    around = surroundings(posture)
    violated = np.zeros(len(model.CAPSULES.frame))
    return gathered(lambda s: terms.free_space(s, around, view, 1.0, 0.25, 5, violated), posture)[:2]


def slope(function, posture: Posture, direction, h: float = 1e-6) -> float:
    """Returns the central difference of an energy along a direction of the unknowns."""
    return (
        function(moved_by(posture, h * direction))[0] - function(moved_by(posture, -h * direction))[0]
    ) / (2 * h)


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_gradient_of_the_data_term_is_half_the_energy_slope(seed):
    posture = random_posture(seed)
    points, normals = surface_points(random_posture(seed + 1, 0.3), seed)
    direction = np.random.default_rng(seed).normal(size=42)
    direction[model.DOFS :] *= 0.05
    _, gradient = depth_energy(posture, points, normals)
    h = 5e-5  # the search runs in single precision
    ways = [explainers(moved_by(posture, s * h * direction), points, normals) for s in (-1, 1)]
    assume(ways[0] == ways[1])  # the energy jumps if a point changes to another capsule
    expected = slope(lambda p: depth_energy(p, points, normals), posture, direction, h)
    assert 2 * gradient @ direction == pytest.approx(expected, rel=0.02, abs=2e-4)


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_gradient_of_self_intersection_is_half_the_energy_slope(seed):
    posture = random_posture(seed, 0.9)
    direction = np.random.default_rng(seed).normal(size=42)
    direction[model.DOFS :] *= 0.05
    _, gradient = self_energy(posture)
    girth = model.DOFS + model.GIRTH
    direction[girth] = 0.0  # the permitted overlap of limbs does not inflate the person
    assert 2 * gradient @ direction == pytest.approx(
        slope(self_energy, posture, direction), rel=0.02, abs=1e-6
    )


@given(st.integers(0, 10_000), st.floats(0.6, 1.5))
@settings(max_examples=25, deadline=None)
def test_the_floors_gradient_by_the_girth_holds_for_every_build(seed, girth):
    posture = random_posture(seed, 0.5)
    posture.position[1] -= 0.5
    posture.lengths[model.GIRTH] = girth
    direction = np.zeros(model.DOFS + len(model.LENGTHS))
    direction[model.DOFS + model.GIRTH] = 1.0
    _, gradient = floor_energy(posture)
    assert 2 * gradient @ direction == pytest.approx(
        slope(floor_energy, posture, direction), rel=0.002, abs=1e-6
    )


@given(st.integers(0, 10_000), st.floats(0.6, 1.5), st.sampled_from([0, 12]))
@settings(max_examples=25, deadline=None)
def test_the_fit_places_the_surface_that_its_terms_are_tested_with(seed, girth, free):
    posture = random_posture(seed, 0.8)
    posture.lengths[model.GIRTH] = girth
    _, surface = place_model(
        BodyState(posture.position, posture.rotations, posture.lengths), create_fit_model(), free
    )
    for mine, expected in zip(surface, surroundings(posture, free, taper=True), strict=True):
        np.testing.assert_allclose(mine, expected, atol=1e-12)


@given(st.integers(0, 10_000), st.floats(0.0, 0.9))
@settings(max_examples=25, deadline=None)
def test_gradient_of_the_floor_is_half_the_energy_slope(seed, sunk):
    posture = random_posture(seed, 0.5)
    posture.position[1] -= sunk
    direction = np.random.default_rng(seed).normal(size=42)
    direction[model.DOFS :] *= 0.05
    _, gradient = floor_energy(posture)
    assert 2 * gradient @ direction == pytest.approx(
        slope(floor_energy, posture, direction), rel=0.02, abs=1e-6
    )


def floor_energy(posture: Posture):
    around = surroundings(posture)
    return gathered(lambda s: terms.above_floor(s, around, 1.0, 0.02), posture)[:2]


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_the_build_is_held_as_its_energy_says(seed):
    """Gradient and matrix equal differences; another size costs a tenth of unusual proportions."""
    random = np.random.default_rng(seed)
    reference = model.lengths_for_height(1.7)
    lengths = reference * random.uniform(0.8, 1.2, 12)

    def held(at):
        matrix, gradient = np.zeros((42, 42)), np.zeros(42)
        energy = terms.keep_proportions(matrix, gradient, at, reference, np.full(12, 7.0), 0.1)
        return energy, gradient[30:], np.triu(matrix[30:, 30:]) + np.triu(matrix[30:, 30:], 1).T

    _, gradient, matrix = held(lengths)
    h = 1e-6
    for p in range(12):
        step = h * np.eye(12)[p]
        difference = (held(lengths + step)[0] - held(lengths - step)[0]) / (2 * h)
        assert 2 * gradient[p] == pytest.approx(difference, rel=1e-4, abs=1e-4)
        curvature = (held(lengths + step)[1] - held(lengths - step)[1]) / (2 * h)
        np.testing.assert_allclose(matrix[p], curvature, rtol=1e-4, atol=1e-4)
    odd, larger = reference.copy(), reference * 1.2
    odd[:11:2] *= 1.2
    odd[1:11:2] *= 0.8
    larger[11] = odd[11] = reference[11]
    assert held(larger)[0] < 0.15 * held(odd)[0]
    assert held(reference)[0] == 0.0


def test_floor_costs_nothing_for_a_standing_person():
    standing = Posture(
        np.array([0.0, 1.0, -2.0]), joint_limits.standing_pose(), model.lengths_for_height(1.7)
    )
    ends, radii = standing.capsules()
    standing.position[1] -= (ends[..., 1] - radii).min()
    assert floor_energy(standing)[0] == 0.0
    standing.position[1] -= 0.1
    assert floor_energy(standing)[0] > 0.0


def test_forces_vanish_on_a_perfectly_fitted_person():
    posture = random_posture(3)
    points, normals = surface_points(posture, 3, noise=0.0)
    energy, gradient = depth_energy(posture, points, normals)
    assert energy < 1e-5
    assert np.abs(gradient).max() < 1e-2


def test_a_limb_in_free_space_is_pushed_into_the_silhouette():
    """The person is a band in the middle, far from the wall. Limbs outside the band move inward."""
    h, w = 120, 160
    depth, mask = np.full((h, w), 5.0), np.zeros((h, w), bool)
    depth[:, 70:90], mask[:, 70:90] = 2.4, True
    mount = np.diag([1.0, -1.0, -1.0, 1.0])
    mount[1, 3] = 1.0
    view = ImageView(depth, mask, nearest_columns(mask), np.array([130.0, 130.0, 79.5, 59.5]), mount)
    posture = Posture(
        np.array([0.0, 0.95, -2.5]), joint_limits.standing_pose(arm_raise=1.4), model.lengths_for_height(1.7)
    )
    energy, gradient = free_space_energy(posture, view)
    assert energy > 0
    lowered = moved_by(posture, -1e-3 * gradient / np.abs(gradient).max())
    assert free_space_energy(lowered, view)[0] < energy
