"""Finds the rigid motion that most nodes of a mesh share."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.kernels import njit
from enliven.rotation import nearest_quaternion, rotation_matrix

_REWEIGHTING_ITERATIONS = 12
"""Number of iterations of reweighted least squares. For a mesh of a chair's size, the last iterations change
the result by less than a millimetre."""
_MIN_WEIGHTED_DISTANCE_M = 2e-3
"""Minimum residual, metres, in the weight of a node. It is the quantization step of transmitted poses, and
limits the weight of nodes that fit exactly."""


def find_shared_motion(positions: Float, rest: Float) -> tuple[Float, Float]:
    """Returns the rotations (F, 3, 3) and translations (F, 3) that move ``rest`` (N, 3) to most of the
    ``positions`` (F, N, 3).

    It is the rigid motion with the smallest sum of distances, computed by iteratively reweighted least
    squares (Weiszfeld's algorithm). So a minority of nodes with other motion has hardly any effect.
    """
    turns, moves = np.zeros((len(positions), 3, 3)), np.zeros((len(positions), 3))
    _fit_shared_motion(
        np.ascontiguousarray(positions, np.float64), np.asarray(rest, np.float64), turns, moves
    )
    return turns, moves


@njit(cache=True, nogil=True)
def _fit_shared_motion(positions, rest, turns, moves):
    """Computes for :func:`find_shared_motion` the rotations ``turns`` (F, 3, 3) and translations ``moves``
    (F, 3)."""
    weights, spread = np.empty(rest.shape[0]), np.empty((3, 3))
    middle, centre = np.empty(3), np.empty(3)
    for f in range(positions.shape[0]):
        weights[:] = 1.0
        for _ in range(_REWEIGHTING_ITERATIONS):
            _weighted_moments(positions[f], rest, weights, middle, centre, spread)
            rotation_matrix(nearest_quaternion(spread), turns[f])
            for i in range(3):
                moves[f, i] = middle[i]
                for j in range(3):
                    moves[f, i] -= turns[f, i, j] * centre[j]
            _update_weights(positions[f], rest, turns[f], moves[f], weights)


@njit(cache=True, nogil=True)
def _weighted_moments(positions, rest, weights, middle, centre, spread):
    """Computes the weighted centres ``middle`` of positions p and ``centre`` of rest positions r, and the
    covariance ``spread`` = sum w (p - middle) (r - centre)^T / sum w."""
    total = weights.sum()
    middle[:], centre[:], spread[:] = 0.0, 0.0, 0.0
    for n in range(rest.shape[0]):
        for i in range(3):
            middle[i] += weights[n] / total * positions[n, i]
            centre[i] += weights[n] / total * rest[n, i]
    for n in range(rest.shape[0]):
        for i in range(3):
            arm = weights[n] / total * (positions[n, i] - middle[i])
            for j in range(3):
                spread[i, j] += arm * (rest[n, j] - centre[j])


@njit(cache=True, nogil=True)
def _update_weights(positions, rest, turn, move, weights):
    """Sets the weight of each node to 1 / residual. The residual is the distance between the node and its
    rest position moved by the shared motion.
    """
    for n in range(rest.shape[0]):
        square = 0.0
        for i in range(3):
            gap = positions[n, i] - move[i]
            for j in range(3):
                gap -= turn[i, j] * rest[n, j]
            square += gap * gap
        weights[n] = 1.0 / max(np.sqrt(square), _MIN_WEIGHTED_DISTANCE_M)
