"""Tests of quaternions in four bytes: the accuracy, and that any four bytes decode to a rotation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.rotation import conjugate, multiply, normalized, to_rotation_vector
from enliven.wire.quaternions import MAX_ROTATION_ERROR, pack_quaternions, unpack_quaternions


def angles(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.linalg.norm(to_rotation_vector(multiply(conjugate(a), b)), axis=-1)


@given(st.integers(0, 2**32), st.floats(0.0, 1.0))
@settings(max_examples=100, deadline=None)
def test_a_rotation_is_at_most_the_stated_angle_off(seed, flat):
    """Also where all components are nearly equal, which is the worst."""
    random = np.random.default_rng(seed)
    q = normalized((1 - flat) * random.normal(size=(50, 4)) + flat * random.choice([-1.0, 1.0], (50, 4)))
    data = pack_quaternions(q)
    assert len(data) == 200
    back = unpack_quaternions(data)
    assert angles(q, back).max() <= MAX_ROTATION_ERROR * 1.001
    assert (back[:, 0] >= 0).all()


def test_the_stated_angle_is_nearly_reached():
    random = np.random.default_rng(0)
    q = normalized(random.normal(0, 0.01, (200_000, 4)) + random.choice([-1.0, 1.0], (200_000, 4)))
    assert angles(q, unpack_quaternions(pack_quaternions(q))).max() > 0.9 * MAX_ROTATION_ERROR


@given(st.binary(min_size=80, max_size=80))
@settings(deadline=None)
def test_any_bytes_are_unit_quaternions(data):
    np.testing.assert_allclose(np.linalg.norm(unpack_quaternions(data), axis=1), 1.0, atol=1e-12)


@pytest.mark.parametrize("axis", range(4))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_turns_about_an_axis_come_back_exactly(axis, sign):
    q = np.zeros((1, 4))
    q[0, axis] = sign
    np.testing.assert_array_equal(np.abs(unpack_quaternions(pack_quaternions(q))), np.abs(q))


def test_invalid_rotation_is_sent_as_identity():
    q = np.array([[np.nan, 0, 0, 1], [0, 0, 0, 0], [np.inf, 0, 0, 0]])
    np.testing.assert_array_equal(unpack_quaternions(pack_quaternions(q)), np.tile([1.0, 0, 0, 0], (3, 1)))


def test_packed_twice_is_packed_once():
    data = pack_quaternions(normalized(np.random.default_rng(1).normal(size=(500, 4))))
    assert pack_quaternions(unpack_quaternions(data)) == data
