"""Tests of the initial state of a frame, against a plain loop over the nodes."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven import rotation
from enliven.deformation.embedded.warm_start import MIN_VOLUME_FRACTION, extrapolate_motion


def gone_on(now, last):
    """Returns (16,) a node whose motion, rotation and stretch from ``last`` to ``now`` continue for one
    frame.
    """
    columns, before = now.reshape(4, 4)[:, :3], last.reshape(4, 4)[:, :3]
    change = columns - before
    turn = 0.5 * np.cross(columns[:3], change[:3]).sum(0)
    there = columns + change
    there[:3] += np.cross(turn, np.cross(turn, columns[:3]))
    if np.linalg.det(there[:3]) < MIN_VOLUME_FRACTION * np.linalg.det(columns[:3]):
        there[:3] = columns[:3]
    return np.concatenate([there, np.zeros((4, 1))], 1).ravel()


def some_nodes(rng, count):
    """Returns (N, 4, 4) nodes with random rotations and small stretches."""
    x = np.zeros((count, 4, 4))
    turns = rotation.to_matrix(rotation.from_rotation_vector(rng.normal(size=(count, 3))))
    x[:, :3, :3] = turns + 0.05 * rng.normal(size=(count, 3, 3))
    x[:, 3, :3] = rng.normal(size=(count, 3))
    return x


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), pace=st.sampled_from([0.01, 0.3, 1.0]))
def test_nodes_go_on_as_they_did_unless_that_would_press_them_flat(seed, pace):
    rng = np.random.default_rng(seed)
    now = some_nodes(rng, 5)
    last, out = now.copy(), np.empty(80)
    last[:, :, :3] += pace * rng.normal(size=(5, 4, 3))
    extrapolate_motion(now.reshape(-1), last.reshape(-1), out)
    expected = [gone_on(a, b) for a, b in zip(now, last, strict=True)]
    # Sums in another order: their last bits are others.
    np.testing.assert_allclose(out.reshape(5, 16), expected, rtol=1e-11, atol=1e-11)


def test_a_node_that_was_halved_keeps_its_shape_and_moves_on():
    now, out = np.zeros((1, 4, 4)), np.empty(16)
    now[0, :3, :3], now[0, 3, 0] = 0.5 * np.eye(3), 1.0
    last = 2.0 * now
    extrapolate_motion(now.reshape(-1), last.reshape(-1), out)
    np.testing.assert_array_equal(out.reshape(4, 4)[:3, :3], now[0, :3, :3])
    np.testing.assert_array_equal(out[12:], np.zeros(4))
