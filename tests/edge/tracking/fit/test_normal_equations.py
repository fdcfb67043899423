"""Tests that sums per body frame give the same normal equations as one row per residual."""

import numpy as np
import pytest
from bodies_for_tests import (
    NO_AFFINITY,
    body_of,
    gathered,
    nearest,
    random_posture,
    seen_as,
    surface_points,
    surroundings,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.fit import data_term
from enliven_edge.tracking.fit import normal_equations as equations
from enliven_edge.tracking.fit.gauss_newton import solve_damped
from enliven_edge.tracking.fit.normal_equations import add_direction_residual, add_point_residual


@given(st.integers(0, 10_000), st.sampled_from([30, 42]))
@settings(max_examples=25, deadline=None)
def test_normal_equations_match_one_row_per_point(seed, count):
    """Compares the fast sums by capsule with the plain sums by point, with the real, tapered capsules."""
    posture = random_posture(seed)
    points, normals = surface_points(random_posture(seed + 1), seed)
    frames, local = model.CAPSULES.frame, model.CAPSULES.ends
    around, body = surroundings(posture, count - model.DOFS, taper=True), body_of(posture)
    ends, radii = around[:2]
    rest = (1.0, 0.07, 0.04, np.zeros(len(frames)))

    def term(sums):
        return data_term.depth_to_model(sums, seen_as(points, normals), NO_AFFINITY, around, *rest)

    (energy, explained), fast_gradient, fast = gathered(term, posture, count - model.DOFS)
    slow, slow_gradient, slow_energy = np.zeros((42, 42)), np.zeros(42), 0.0
    for point, normal in zip(points, normals, strict=True):
        c, t, distance = nearest(point, normal, ends, radii)
        cost, weight = equations.robust(distance, 0.07)
        slow_energy += cost / len(points)
        foot = ends[c, 0] + t * (ends[c, 1] - ends[c, 0])
        outward = (point - foot) / np.linalg.norm(point - foot)
        row = np.zeros(42)
        equations.point_row(
            row, -1.0, frames[c], foot, outward, (1 - t) * local[c, 0] + t * local[c, 1], body
        )
        row[-1] -= (radii[c, 0] + t * (radii[c, 1] - radii[c, 0])) / posture.lengths[-1]
        slow += weight / len(points) * np.outer(row, row)
        slow_gradient += weight / len(points) * distance * row
    # Search and moments run in single precision.
    assert energy == pytest.approx(slow_energy, rel=1e-4)
    assert 0 <= explained <= 1
    np.testing.assert_allclose(fast_gradient, slow_gradient[:count], atol=1e-6)
    np.testing.assert_allclose(np.triu(fast), np.triu(slow)[:count, :count], atol=1e-5)


@given(st.integers(0, 10_000), st.sampled_from([30, 42]))
@settings(max_examples=25, deadline=None)
def test_rays_and_places_match_one_row_per_residual(seed, count):
    """For every frame and any direction; a position counts as three rays along the axes."""
    dice, posture, free = np.random.default_rng(seed), random_posture(seed, 0.8), count - model.DOFS
    body, rows = body_of(posture, free), []

    def term(sums):
        for joint, frame in enumerate(model.JOINT_FRAMES):
            at, local = posture.joints()[joint], model.JOINT_OFFSETS[joint]
            by, apart, normal = np.empty((3, free)), dice.normal(size=3), dice.normal(size=3)
            equations.by_length(by, frame, local, body)
            residual, weight = dice.normal(), dice.uniform(0, 2)
            add_direction_residual(
                sums, frame, normal, at, normal @ by, model.FRAME_LENGTHS, residual, weight
            )
            add_point_residual(sums, frame, at, apart, by, model.FRAME_LENGTHS, weight)
            ways = [(normal, residual), *zip(np.eye(3), apart, strict=True)]
            rows.extend((frame, at, way, local, much, weight) for way, much in ways)

    _, gradient, matrix = gathered(term, posture, free)
    slow, slow_gradient = np.zeros((count, count)), np.zeros(count)
    for frame, at, way, local, much, weight in rows:
        row = np.zeros(count)
        equations.point_row(row, 1.0, frame, at, way, local, body)
        slow += weight * np.outer(row, row)
        slow_gradient += weight * much * row
    np.testing.assert_allclose(gradient, slow_gradient, atol=1e-9)
    np.testing.assert_allclose(np.triu(matrix), np.triu(slow), atol=1e-9)


@given(st.integers(0, 10_000), st.floats(1e-6, 10.0), st.sampled_from([30, 42]))
@settings(max_examples=25, deadline=None)
def test_the_damped_step_solves_the_damped_system(seed, damping, count):
    rows = np.random.default_rng(seed).normal(size=(2 * count, count))
    gradient = rows[0].copy()
    matrix = rows.T @ rows
    step = np.empty(count)
    solve_damped(step, np.empty((count, count)), np.triu(matrix), gradient, damping)
    damped = matrix + np.diag(damping * np.diag(matrix) + 1e-3)
    np.testing.assert_allclose(damped @ step, -gradient, atol=1e-8)
