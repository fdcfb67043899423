"""Tests of rotations for any batch shape, and of the nearest rotation against the SVD."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven import rotation

SHAPES = st.sampled_from([(), (1,), (5,), (2, 3), (0,), (2, 1, 4)])
SEEDS = st.integers(0, 2**32 - 1)
laws = settings(deadline=None, max_examples=60)


def random_quaternions(shape, seed):
    return rotation.normalized(np.random.default_rng(seed).normal(size=(*shape, 4)))


def random_vectors(shape, seed):
    return np.random.default_rng(seed + 1).normal(size=(*shape, 3))


@laws
@given(SHAPES, SEEDS)
def test_products_are_closed_and_associative(shape, seed):
    a, b, c = (random_quaternions(shape, seed + i) for i in range(3))
    ab = rotation.multiply(a, b)
    assert ab.shape == (*shape, 4)
    np.testing.assert_allclose(np.linalg.norm(ab, axis=-1), 1, atol=1e-12)
    left = rotation.multiply(ab, c)
    np.testing.assert_allclose(left, rotation.multiply(a, rotation.multiply(b, c)), atol=1e-12)


@laws
@given(SHAPES, SEEDS)
def test_identity_and_inverse(shape, seed):
    q = random_quaternions(shape, seed)
    np.testing.assert_allclose(rotation.multiply(q, rotation.IDENTITY), q, atol=1e-15)
    unit = rotation.multiply(q, rotation.conjugate(q))
    np.testing.assert_allclose(unit, np.broadcast_to(rotation.IDENTITY, unit.shape), atol=1e-12)


@laws
@given(SHAPES, SEEDS)
def test_quaternions_matrices_and_vectors_agree(shape, seed):
    a, b = random_quaternions(shape, seed), random_quaternions(shape, seed + 7)
    v = random_vectors(shape, seed)
    matrix = rotation.to_matrix(rotation.multiply(a, b))
    turned = rotation.rotate(a, rotation.rotate(b, v))
    np.testing.assert_allclose(np.einsum("...ab,...b->...a", matrix, v), turned, atol=1e-12)
    back = rotation.from_matrix(rotation.to_matrix(a))
    np.testing.assert_allclose(back, rotation.canonical(a), atol=1e-9)


@laws
@given(SHAPES, SEEDS, st.floats(1e-12, np.pi - 1e-6))
def test_rotation_vectors_round_trip(shape, seed, angle):
    v = random_vectors(shape, seed)
    v = v / np.linalg.norm(v, axis=-1, keepdims=True) * angle
    back = rotation.to_rotation_vector(rotation.from_rotation_vector(v))
    np.testing.assert_allclose(back, v, rtol=1e-6, atol=1e-12)


@laws
@given(SHAPES, SEEDS, st.floats(0, 1))
def test_slerp_is_an_even_turn_from_end_to_end(shape, seed, t):
    a, b = random_quaternions(shape, seed), random_quaternions(shape, seed + 3)
    np.testing.assert_allclose(rotation.slerp(a, b, 0.0), a, atol=1e-12)
    np.testing.assert_allclose(np.abs((rotation.slerp(a, b, 1.0) * b).sum(-1)), 1, atol=1e-12)
    whole = np.linalg.norm(rotation.to_rotation_vector(rotation.multiply(rotation.conjugate(a), b)), axis=-1)
    part = rotation.multiply(rotation.conjugate(a), rotation.slerp(a, b, t))
    turned = np.linalg.norm(rotation.to_rotation_vector(part), axis=-1)
    np.testing.assert_allclose(turned, t * whole, atol=1e-7)


@laws
@given(SHAPES, SEEDS)
def test_swing_takes_one_vector_to_the_other_by_the_shortest_arc(shape, seed):
    a, b = random_vectors(shape, seed), random_vectors(shape, seed + 5)
    a, b = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in (a, b))
    q = rotation.swing(a, b)
    np.testing.assert_allclose(rotation.rotate(q, a), b, atol=1e-12)
    angle = np.linalg.norm(rotation.to_rotation_vector(q), axis=-1)
    np.testing.assert_allclose(np.cos(angle), (a * b).sum(-1), atol=1e-12)


@pytest.mark.parametrize("gap", [0.0, 1e-15, 1e-9, 1e-5])
def test_swing_between_nearly_opposite_vectors(gap):
    a = np.array([0.0, 1.0, 0.0])
    b = np.array([gap, -1.0, 0.0]) / np.hypot(gap, 1.0)
    q = rotation.swing(a, b)
    np.testing.assert_allclose(np.linalg.norm(q), 1, atol=1e-12)
    np.testing.assert_allclose(rotation.rotate(q, a), b, atol=1e-9)


def svd_nearest(matrices):
    """Returns the nearest rotations by the SVD: U diag(1, 1, det(U Vᵀ)) Vᵀ."""
    u, _, v = np.linalg.svd(matrices)
    u[..., 2] *= np.linalg.det(u @ v)[..., None]
    return u @ v


@laws
@given(SHAPES, SEEDS)
def test_nearest_rotation_equals_the_svd(shape, seed):
    m = np.random.default_rng(seed).normal(size=(*shape, 3, 3))
    singular = np.linalg.svd(m, compute_uv=False)
    # If the two smallest singular values cancel, two rotations are equally close, and the SVD is not a
    # reference.
    clear = np.sign(np.linalg.det(m)) * singular[..., 2] + singular[..., 1] > 1e-3
    nearest = rotation.nearest_rotation(m)
    np.testing.assert_allclose(nearest[clear], svd_nearest(m)[clear], atol=1e-9)
    compiled = np.empty((m.size // 9, 3, 3))
    rotation.nearest_rotations(m.reshape(-1, 3, 3), compiled)
    np.testing.assert_allclose(compiled.reshape(nearest.shape), nearest, atol=1e-12)


@pytest.mark.parametrize(
    "matrix",
    [
        np.zeros((3, 3)),
        np.diag([1.0, 1.0, -1.0]),
        -np.eye(3),
        np.diag([1.0, 0.0, 0.0]),
        np.outer([1.0, 2.0, 3.0], [0.0, 1.0, -1.0]),
        np.full((3, 3), np.nan),
        np.diag([1e-200, 1e-200, 1e-200]),
        np.diag([1e200, 1e180, 1.0]),
    ],
)
def test_nearest_rotation_is_always_proper(matrix):
    r = rotation.nearest_rotation(matrix)
    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(r) == pytest.approx(1.0)
    if np.isfinite(matrix).all() and 0 < np.abs(matrix).max() < 1e100:
        assert np.trace(r.T @ matrix) == pytest.approx(np.trace(svd_nearest(matrix).T @ matrix))


def test_normalized_repairs_invalid_rotations():
    q = rotation.normalized(np.array([[0, 0, 0, 0], [np.nan, 1, 0, 0], [1e-300, 0, 0, 0], [0, 3, 0, 4]]))
    np.testing.assert_allclose(q, [[1, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0], [0, 0.6, 0, 0.8]])
