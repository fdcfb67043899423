"""What keeps a solve sane when targets jump or lie: a good place to start, and no node inside out."""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven.deformation.energy import gradient
from enliven.rotation import nearest_rotations

_LEAST_VOLUME = 0.05
"""The determinant of a node's linear part below which it counts as collapsed or inside out."""


@njit(cache=True, nogil=True)
def choose_start(x, rest, t, now, trial):  # type: ignore[no-untyped-def]
    """Kernel: start from the best of: the last frame; that, moved rigidly; the rest pose, moved rigidly.

    The rigid motion is the one that best brings the points to their targets. E_rot and E_reg do not change
    in it, so a body that turns or leaps costs nothing; and a state that wild targets have spoilt is left as
    soon as the rest pose does better. Returns whether the rest pose was taken. ``now`` and ``trial``
    (N, 4, 3) are room to work in.
    """
    turn, middle, goal = np.empty((3, 3)), np.empty(3), np.empty(3)
    if not _rigid_motion(x, t, turn, middle, goal):
        return False
    least = gradient(x, t, now)[4]
    _moved(x, turn, middle, goal, trial)
    energy = gradient(trial, t, now)[4]
    if energy < least or not np.isfinite(least):
        least = energy
        x[:] = trial
    _rigid_motion(rest, t, turn, middle, goal)
    _moved(rest, turn, middle, goal, trial)
    if gradient(trial, t, now)[4] < least:
        x[:] = trial
        return True
    return False


@njit(cache=True, nogil=True)
def _moved(x, turn, middle, goal, out):  # type: ignore[no-untyped-def]
    """``out`` takes ``x`` turned about ``middle``, which goes to ``goal``."""
    for n in range(x.shape[0]):
        for a in range(3):
            for c in range(4):
                total = 0.0 if c < 3 else goal[a]
                for b in range(3):
                    total += turn[a, b] * (x[n, c, b] - (0.0 if c < 3 else middle[b]))
                out[n, c, a] = total


@njit(cache=True, nogil=True)
def _rigid_motion(x, t, turn, middle, goal):  # type: ignore[no-untyped-def]
    """The rotation about ``middle``, which goes to ``goal``; False where nothing pulls."""
    count = t.nodes.shape[0]
    points = np.zeros((count, 3))
    middle[:] = 0.0
    goal[:] = 0.0
    total = 0.0
    for m in range(count):
        total += t.pulls[m]
        for a in range(3):
            for k in range(4):
                for c in range(4):
                    points[m, a] += t.rows[m, k, c] * x[t.nodes[m, k], c, a]
            middle[a] += t.pulls[m] * points[m, a]
            goal[a] += t.pulls[m] * t.targets[m, a]
    if not total > 0.0:
        return False
    for a in range(3):
        middle[a] /= total
        goal[a] /= total
    spread = np.zeros((1, 3, 3))
    size = 0.0
    for m in range(count):
        for a in range(3):
            size += t.pulls[m] * (points[m, a] - middle[a]) ** 2
            for b in range(3):
                spread[0, a, b] += t.pulls[m] * (t.targets[m, a] - goal[a]) * (points[m, b] - middle[b])
    # A pull to "no turn": the points may lie on a line, about which any turn would be as good.
    for a in range(3):
        spread[0, a, a] += 1e-6 * size + 1e-12
    nearest_rotations(spread, turn.reshape(1, 3, 3))
    return True


@njit(cache=True, nogil=True)
def set_upright(x, edges):  # type: ignore[no-untyped-def]
    """Kernel: give each node that is collapsed or inside out the mean rotation of its sound neighbours.

    A mirrored node has no E_rot, and where the surface is flat no E_reg either: descending does not always
    mend it. Returns whether any was found.
    """
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
                    mean[0] += x[other, :3]
                    found[n] = True
            if found[n]:
                nearest_rotations(mean, turn)
                x[n, :3] = turn[0]
        if (found == sound).all():
            # Nobody is sound: each takes the rotation nearest to what it has.
            for n in range(count):
                if not sound[n]:
                    mean[0] = x[n, :3]
                    nearest_rotations(mean, turn)
                    x[n, :3] = turn[0]
            break
        sound = found
    return True


@njit(cache=True, nogil=True)
def _volume(node):  # type: ignore[no-untyped-def]
    """The determinant of R, whose columns are the first three rows of ``node`` (4, 3)."""
    return (
        node[0, 0] * (node[1, 1] * node[2, 2] - node[1, 2] * node[2, 1])
        - node[0, 1] * (node[1, 0] * node[2, 2] - node[1, 2] * node[2, 0])
        + node[0, 2] * (node[1, 0] * node[2, 1] - node[1, 1] * node[2, 0])
    )
