"""Tests of the conversion to Unity's axes, against independent mathematics."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from live_receivers import euler_turn, turn

from enliven.person.unity_axes import unity_euler, unity_position, unity_rotation
from enliven.rotation import from_rotation_vector, multiply, normalized, rotate

NUMBERS = st.floats(-3.0, 3.0)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS).map(np.array)
TURNS = VECTORS.map(from_rotation_vector)


@given(TURNS, VECTORS)
def test_rotating_and_converting_commute(q, v):
    expected = unity_position(rotate(q, v))
    assert np.allclose(turn(unity_rotation(q), unity_position(v)), expected, atol=1e-9)


@given(TURNS, TURNS)
def test_conversion_keeps_products_of_rotations(a, b):
    product = unity_rotation(multiply(a, b))
    vector = np.array([0.3, -1.0, 0.7])
    assert np.allclose(
        turn(product, vector), turn(unity_rotation(a), turn(unity_rotation(b), vector)), atol=1e-9
    )


@given(TURNS, VECTORS)
def test_euler_angles_rotate_as_the_quaternion(q, v):
    assert np.allclose(euler_turn(unity_euler(q), v), turn(unity_rotation(q), v), atol=1e-6)


@given(st.sampled_from([-1.0, 1.0]), st.floats(-3.0, 3.0))
def test_euler_angles_hold_at_the_poles(sign, yaw):
    q = multiply(from_rotation_vector([0, yaw, 0]), from_rotation_vector([sign * np.pi / 2, 0, 0]))
    for v in np.eye(3):
        assert np.allclose(euler_turn(unity_euler(normalized(q)), v), turn(unity_rotation(q), v), atol=1e-4)


def test_left_is_at_minus_x_and_front_at_plus_z():
    assert unity_position([1.0, 2.0, 3.0]).tolist() == [-1.0, 2.0, 3.0]
    # A quarter turn to the performer's left: from +Z to +X here, and from +Z to -X in Unity.
    left = from_rotation_vector([0.0, np.pi / 2, 0.0])
    assert np.allclose(rotate(left, [0, 0, 1]), [1, 0, 0])
    assert np.allclose(turn(unity_rotation(left), [0, 0, 1]), [-1, 0, 0])
    assert np.allclose(unity_euler(left), [0, -90, 0])
