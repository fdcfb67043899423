"""The rigid motion that most of the nodes of a mesh share."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.kernels import njit
from enliven.rotation import nearest_quaternion, rotation_matrix

_ROUNDS = 12
"""Rounds of reweighted least squares: the last ones move a chair by less than a millimetre."""
_NEAR = 2e-3
"""Metres of distance below which weights no longer grow: the steps of poses on the wire."""


def shared_motion(positions: Float, rest: Float) -> tuple[Float, Float]:
    """Returns the turns (F, 3, 3) and moves (F, 3) that take rest (N, 3) to most of positions (F, N, 3).

    It is the rigid motion with the least sum of distances, by least squares with weights anew (Weiszfeld's
    way): nodes that go elsewhere, fewer than half, hardly count.
    """
    turns, moves = np.zeros((len(positions), 3, 3)), np.zeros((len(positions), 3))
    _shared(np.ascontiguousarray(positions, np.float64), np.asarray(rest, np.float64), turns, moves)
    return turns, moves


@njit(cache=True, nogil=True)
def _shared(positions, rest, turns, moves):
    """Kernel: fills ``turns`` (F, 3, 3) and ``moves`` (F, 3)."""
    weights, spread = np.empty(rest.shape[0]), np.empty((3, 3))
    middle, centre = np.empty(3), np.empty(3)
    for f in range(positions.shape[0]):
        weights[:] = 1.0
        for _ in range(_ROUNDS):
            _weighted(positions[f], rest, weights, middle, centre, spread)
            rotation_matrix(nearest_quaternion(spread), turns[f])
            for i in range(3):
                moves[f, i] = middle[i]
                for j in range(3):
                    moves[f, i] -= turns[f, i, j] * centre[j]
            _weigh(positions[f], rest, turns[f], moves[f], weights)


@njit(cache=True, nogil=True)
def _weighted(positions, rest, weights, middle, centre, spread):
    """Kernel: the weighted middles of both, and sum w (p - middle) (r - centre)^T over the sum of weights."""
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
def _weigh(positions, rest, turn, move, weights):
    """Kernel: each weight becomes one over how far its node is from where the motion takes it."""
    for n in range(rest.shape[0]):
        apart = 0.0
        for i in range(3):
            gap = positions[n, i] - move[i]
            for j in range(3):
                gap -= turn[i, j] * rest[n, j]
            apart += gap * gap
        weights[n] = 1.0 / max(np.sqrt(apart), _NEAR)
