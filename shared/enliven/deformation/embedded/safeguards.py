"""Safeguards for targets that jump or are wrong: no node stays inside out."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven.rotation import nearest_rotations

_LEAST_VOLUME = 0.05
"""The determinant of a node's linear part below which it counts as collapsed or inside out."""


@njit(cache=True, nogil=True)
def set_upright(flat, edges):  # type: ignore[no-untyped-def]
    """Kernel: give each node of ``flat`` (16 N,) that is collapsed or inside out the mean rotation of its
    sound neighbours.

    A mirrored node has no E_rot, and where the surface is flat no E_reg either: descending does not always
    mend it. Returns whether any was found.
    """
    x = flat.reshape(-1, 4, 4)
    count = x.shape[0]
    sound = np.empty(count, np.bool_)
    for n in range(count):
        sound[n] = _volume(x[n]) > _LEAST_VOLUME
    if sound.all():
        return False
    mean, turn = np.empty((1, 3, 3)), np.empty((1, 3, 3))
    while not sound.all():
        found = sound.copy()
        for n in range(count):
            if sound[n]:
                continue
            mean[:] = 0.0
            for e in range(edges.shape[0]):
                i, j = edges[e, 0], edges[e, 1]
                other = j if i == n else i
                if (i == n or j == n) and sound[other]:
                    for a in range(3):
                        for b in range(3):
                            mean[0, a, b] += x[other, a, b]
                    found[n] = True
            if found[n]:
                nearest_rotations(mean, turn)
                _copy_turn(x[n], turn[0])
        if (found == sound).all():
            # Nobody is sound: each takes the rotation nearest to what it has.
            for n in range(count):
                if not sound[n]:
                    _copy_turn(mean[0], x[n])
                    nearest_rotations(mean, turn)
                    _copy_turn(x[n], turn[0])
            break
        sound = found
    return True


@njit(cache=True, nogil=True)
def _copy_turn(target, source):  # type: ignore[no-untyped-def]
    """Write the first three rows and columns of ``source`` into those of ``target``."""
    for a in range(3):
        for b in range(3):
            target[a, b] = source[a, b]


@njit(cache=True, nogil=True)
def _volume(node):  # type: ignore[no-untyped-def]
    """The determinant of R: its columns are the first three rows of ``node`` (4, 4)."""
    return (
        node[0, 0] * (node[1, 1] * node[2, 2] - node[1, 2] * node[2, 1])
        - node[0, 1] * (node[1, 0] * node[2, 2] - node[1, 2] * node[2, 0])
        + node[0, 2] * (node[1, 0] * node[2, 1] - node[1, 1] * node[2, 0])
    )
