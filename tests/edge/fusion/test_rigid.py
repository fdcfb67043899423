"""Tests of fitting rigid transforms to corresponding points."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from enliven.space.rigid_transform import (
    angle_between,
    compose_transform,
    fit_rigid,
    invert,
    rotation_from_vector,
    rotation_vector,
    transform_points,
)

ANGLES = st.tuples(*[st.floats(-1.8, 1.8)] * 3).map(np.array)
SHIFTS = st.tuples(*[st.floats(-5, 5)] * 3).map(np.array)


def points(seed: int, count: int = 12) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (count, 3))


@given(ANGLES, SHIFTS, st.integers(0, 99))
def test_exact_points_give_the_exact_transform(vector, shift, seed):
    true = compose_transform(rotation_from_vector(vector), shift)
    source = points(seed)
    weights = np.random.default_rng(seed + 1).uniform(0.1, 1, len(source))
    assert np.allclose(
        fit_rigid(source, transform_points(true, source), weights, upright=False), true, atol=1e-9
    )


@given(st.floats(-3.1, 3.1), SHIFTS, st.integers(0, 99))
def test_an_upright_turn_is_found_by_the_upright_fit(angle, shift, seed):
    true = compose_transform(rotation_from_vector(np.array([0.0, angle, 0.0])), shift)
    source = points(seed)
    assert np.allclose(
        fit_rigid(source, transform_points(true, source), np.ones(12), upright=True), true, atol=1e-9
    )


def test_no_other_transform_is_better():
    """With noise, every other transform near the result has a larger sum of squares."""
    random = np.random.default_rng(3)
    source, weights = points(1), random.uniform(0.1, 1, 12)
    target = transform_points(
        compose_transform(rotation_from_vector(np.array([0.3, 0.2, -0.5])), np.ones(3)), source
    ) + 0.05 * points(2)

    def cost(transform):
        return float(weights @ ((transform_points(transform, source) - target) ** 2).sum(1))

    for upright in (False, True):
        best = fit_rigid(source, target, weights, upright=upright)
        for _ in range(50):
            step = 0.05 * random.standard_normal(6)
            if upright:
                step[[0, 2]] = 0.0
            other = compose_transform(rotation_from_vector(step[:3]) @ best[:3, :3], best[:3, 3] + step[3:])
            assert cost(best) <= cost(other) + 1e-12


def test_mirrored_points_give_a_rotation_still():
    source = points(5)
    motion = fit_rigid(source, source * [-1, 1, 1], np.ones(12), upright=False)
    assert np.linalg.det(motion[:3, :3]) > 0.999


@given(ANGLES, SHIFTS)
def test_there_and_back(vector, shift):
    transform = compose_transform(rotation_from_vector(vector), shift)
    assert np.allclose(invert(transform) @ transform, np.eye(4), atol=1e-12)


@given(ANGLES)
def test_a_rotation_vector_comes_back(vector):
    assert (
        np.allclose(rotation_vector(rotation_from_vector(vector)), vector, atol=1e-7)
        or np.linalg.norm(vector) > np.pi
    )
    assert np.isclose(
        angle_between(np.eye(3), rotation_from_vector(vector)), min(np.linalg.norm(vector), np.pi), atol=1e-7
    ) or (np.linalg.norm(vector) > np.pi)


def test_half_a_turn_has_a_vector():
    for axis in np.eye(3):
        assert np.isclose(np.linalg.norm(rotation_vector(rotation_from_vector(np.pi * axis))), np.pi)
