"""Safeguards against targets that jump or are wrong: no node stays inside out."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven.rotation import nearest_rotations

_MIN_SOUND_DETERMINANT = 0.02
"""A node counts as collapsed or inside out if the determinant of its linear part is below this value."""
_LEAST_VOLUME = 0.05
"""Minimum determinant of a node's linear part after a repair. The node then has a twentieth of its thickness
at rest."""
_NEWTON_STEPS = 8
"""Number of Newton steps that restore the determinant. Each step squares the error, so three steps are enough
for a determinant of 0.02."""


@njit(cache=True, nogil=True)
def repair_inverted_nodes(flat, edges):
    """Replaces each collapsed or inverted node of ``flat`` (16 N,) by the mean rotation of its intact
    neighbours. A mirrored node has zero E_rot, and on a flat surface also zero E_reg, so the descent does not
    always repair it. Returns True if any node was replaced.
    """
    x = flat.reshape(-1, 4, 4)
    count = x.shape[0]
    sound = np.empty(count, np.bool_)
    for n in range(count):
        sound[n] = compute_determinant(x[n]) > _MIN_SOUND_DETERMINANT
    if sound.all():
        return False
    mean, turn = np.empty((1, 3, 3)), np.empty((1, 3, 3))
    while not sound.all():
        repaired = sound.copy()
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
                    repaired[n] = True
            if repaired[n]:
                nearest_rotations(mean, turn)
                _copy_rotation(x[n], turn[0])
        if (repaired == sound).all():
            # No node is intact, so give each node the rotation that is nearest to its own matrix.
            for n in range(count):
                if not sound[n]:
                    _copy_rotation(mean[0], x[n])
                    nearest_rotations(mean, turn)
                    _copy_rotation(x[n], turn[0])
            break
        sound = repaired
    return True


@njit(cache=True, nogil=True)
def restore_flat_nodes(flat):
    """Restores the minimum volume of the nodes of ``flat`` (16 N,) that are pressed flatter.

    The cofactor matrix of R has the singular vectors of R, and is largest in the direction in which R is
    flattest. A change along this matrix has almost no effect on the energy. Returns True if any node was
    changed.
    """
    x = flat.reshape(-1, 4, 4)
    has_flat = False
    cofactor = np.empty((3, 3))
    for n in range(x.shape[0]):
        if compute_determinant(x[n]) >= _LEAST_VOLUME:
            continue
        has_flat = True
        for _ in range(_NEWTON_STEPS):
            square = 0.0
            for c in range(3):
                d, e = (c + 1) % 3, (c + 2) % 3
                for a in range(3):
                    b, k = (a + 1) % 3, (a + 2) % 3
                    cofactor[c, a] = x[n, d, b] * x[n, e, k] - x[n, d, k] * x[n, e, b]
                    square += cofactor[c, a] ** 2
            scale = (1.001 * _LEAST_VOLUME - compute_determinant(x[n])) / (square + 1e-12)
            for c in range(3):
                for a in range(3):
                    x[n, c, a] += scale * cofactor[c, a]
    return has_flat


@njit(cache=True, nogil=True)
def _copy_rotation(target, source):
    """Copies the first three rows and columns of ``source`` (4, 4) into ``target`` (4, 4)."""
    for a in range(3):
        for b in range(3):
            target[a, b] = source[a, b]


@njit(cache=True, nogil=True)
def compute_determinant(node):
    """Returns the determinant of R. The columns of R are the first three rows of ``node`` (4, 4)."""
    return (
        node[0, 0] * (node[1, 1] * node[2, 2] - node[1, 2] * node[2, 1])
        - node[0, 1] * (node[1, 0] * node[2, 2] - node[1, 2] * node[2, 0])
        + node[0, 2] * (node[1, 0] * node[2, 1] - node[1, 1] * node[2, 0])
    )
