"""Chooses the initial state of a frame: the extrapolated last frame, or another state with lower energy."""

from __future__ import annotations

import numpy as np

from enliven.deformation.embedded.energy import compute_energy_gradient, constraint_energy
from enliven.kernels import copy_row, njit
from enliven.lanes import cross4, fma4, load4, splat4, store4, total4
from enliven.rotation import nearest_rotations

_BAD_START_ENERGY_RATIO = 4.0
"""Maximum ratio of a start's energy to the energy of the last frame. Above it, more candidates are tried."""

MIN_VOLUME_FRACTION = 0.5
"""Minimum fraction of its volume that a node must keep for its matrix to be extrapolated."""


@njit(cache=True, nogil=True)
def choose_start(x, rest, t, planes, work):
    """Chooses the start with the lowest energy: the last frame, its extrapolation, either of them moved
    rigidly, or the rest pose moved rigidly.

    The rigid motion is the motion that best moves the points to their targets. It does not change E_rot and
    E_reg, so a leap of the whole body does not increase the energy. If the state was distorted by wrong
    targets, the rest pose soon becomes the better start. The rigidly moved candidates are tried only if the
    other candidates are bad. Returns True if ``work.raw`` and ``work.energies`` already belong to the chosen
    start.
    """
    before = work.energies
    least = before[0] + before[1] + constraint_energy(x, t) + before[3] + before[4]
    settled = before[5]
    extrapolate_motion(x, work.last, work.trial)
    copy_row(work.last, x)
    energies = compute_energy_gradient(work.trial, t, planes, work.raw)
    goes_on = energies[5] < least or not np.isfinite(least)
    if goes_on:
        least = energies[5]
        copy_row(x, work.trial)
    if least <= _BAD_START_ENERGY_RATIO * settled + 1e-6:
        if goes_on:
            for i in range(6):
                before[i] = energies[i]
        return goes_on
    turn, middle, goal = np.empty((3, 3)), np.empty(3), np.empty(3)
    for origin in (x, rest):
        if _rigid_motion(origin, t, turn, middle, goal):
            _rotated_state(origin, turn, middle, goal, work.trial)
            energy = compute_energy_gradient(work.trial, t, planes, work.raw)[5]
            if energy < least or not np.isfinite(least):
                least = energy
                copy_row(x, work.trial)
    return False


@njit(cache=True, nogil=True)
def extrapolate_motion(x, last, out):
    """Extrapolates the motion of the nodes between the last two frames by one frame, into ``out``.

    To second order, R(1) = R + d + w x (w x R), where d = R - R(-1), and w is the rotation of d.
    """
    for at in range(0, x.shape[0], 16):
        a, b, c = load4(x, at), load4(x, at + 4), load4(x, at + 8)
        p, q, r = a - load4(last, at), b - load4(last, at + 4), c - load4(last, at + 8)
        turn = splat4(0.5) * (cross4(a, p) + cross4(b, q) + cross4(c, r))
        square = total4(turn * turn)
        p, q, r = a + p, b + q, c + r
        p = fma4(total4(turn * a), turn, fma4(-square, a, p))
        q = fma4(total4(turn * b), turn, fma4(-square, b, q))
        r = fma4(total4(turn * c), turn, fma4(-square, c, r))
        if total4(p * cross4(q, r)) < MIN_VOLUME_FRACTION * total4(a * cross4(b, c)):
            # The node shrinks so fast that another frame of extrapolation would make it flat or turn it
            # inside out. So keep its current matrix.
            p, q, r = a, b, c
        here = load4(x, at + 12)
        store4(out, at, p)
        store4(out, at + 4, q)
        store4(out, at + 8, r)
        store4(out, at + 12, here + here - load4(last, at + 12))


@njit(cache=True, nogil=True)
def _rotated_state(x, turn, middle, goal, out):
    """Rotates the state ``x`` (16 N,) by ``turn`` about the point ``middle``, and moves this point to
    ``goal``. The result is written into ``out``."""
    for j in range(x.shape[0] // 16):
        for c in range(4):
            at = 16 * j + 4 * c
            out[at + 3] = 0.0
            for a in range(3):
                total = goal[a] if c == 3 else 0.0
                for b in range(3):
                    total += turn[a, b] * (x[at + b] - (middle[b] if c == 3 else 0.0))
                out[at + a] = total


@njit(cache=True, nogil=True)
def _rigid_motion(x, t, turn, middle, goal):
    """Computes the rigid motion that moves the points to their targets: a rotation ``turn`` (3, 3) about the
    point ``middle`` (3,), which moves to ``goal`` (3,). Returns False if no constraint has weight."""
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
                    points[m, a] += t.rows[m, k, c] * x[16 * t.nodes[m, k] + 4 * c + a]
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
    # Add a small bias towards the identity. If the points lie on a line, every rotation about this line fits
    # equally well, and the bias selects the smallest rotation.
    for a in range(3):
        spread[0, a, a] += 1e-6 * size + 1e-12
    nearest_rotations(spread, turn.reshape(1, 3, 3))
    return True
