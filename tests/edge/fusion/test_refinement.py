"""Tests that the normal equations of two sensors' poses equal those of the plain Jacobian."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven_edge.fusion.calibration.refinement import normal_equations


def jacobian_of(arm: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Returns the (3, 7) derivative of a joint by rotation, translation and lag."""
    x, y, z = arm
    turned = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    return np.concatenate([turned, np.eye(3), -velocity[:, None]], 1)


@settings(deadline=None, max_examples=30)
@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_normal_equations_match_the_slow_reference(frames, seed):
    dice = np.random.default_rng(seed)
    arm, velocity, error = dice.normal(size=(3, frames, 20, 3))
    weights = dice.random((frames, 20)) * (dice.random((frames, 20)) < 0.7)
    h, g = np.zeros((7, 7)), np.zeros(7)
    for index in np.ndindex(frames, 20):
        jacobian = jacobian_of(arm[index], velocity[index])
        h += weights[index] * jacobian.T @ jacobian
        g += weights[index] * jacobian.T @ error[index]
    equations = normal_equations(arm, velocity, error, weights)
    # Sums of some hundred numbers near one, in another order.
    np.testing.assert_allclose(equations[0], h, rtol=0, atol=1e-9)
    np.testing.assert_allclose(equations[1], g, rtol=0, atol=1e-9)
