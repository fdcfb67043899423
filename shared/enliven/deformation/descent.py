"""Preconditioned L-BFGS with exact steps, in compiled loops; see :mod:`enliven.deformation.embedded`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from enliven.arrays import Float, Int
from enliven.deformation.block_cholesky import factorise, substitute
from enliven.deformation.energy import CON, REG, RIG, ROT, along_line, best_step, gradient
from enliven.deformation.safeguards import choose_start, set_upright

_PAIRS = 8
_NEGLIGIBLE = 1e-9
"""An energy that nobody sees: with the default weights, every point 3 micrometres off."""
_TIKHONOV = 1e-6
"""Keeps the matrix definite where nothing holds a node; the energy itself has no such term."""


class Memory(NamedTuple):
    """The last steps and changes of the gradient that L-BFGS remembers, and room to work in.

    Attributes:
        steps: (M, 12 N).
        changes: (M, 12 N).
        curvatures: (M,) their inner products.
        room: (3, N, 4, 3).
        kept: (1,) int64 how many there have been.
    """

    steps: Float
    changes: Float
    curvatures: Float
    room: Float
    kept: Int

    @staticmethod
    def empty(count: int) -> Memory:
        """Nothing remembered, for ``count`` nodes."""
        shape = (_PAIRS, 12 * count)
        return Memory(
            np.zeros(shape),
            np.zeros(shape),
            np.zeros(_PAIRS),
            np.zeros((3, count, 4, 3)),
            np.zeros(1, np.int64),
        )


@njit(cache=True, nogil=True)
def _add(blocks, start, row, i, j, u, v, w):  # type: ignore[no-untyped-def]
    """Add w u vᵀ (u, v (4,)) at nodes (i, j), where i >= j; blocks above the diagonal are left out."""
    if i < j:
        return
    low, high = start[j], start[j + 1] - 1
    while low < high:
        middle = (low + high) // 2
        if row[middle] < i:
            low = middle + 1
        else:
            high = middle
    for r in range(4):
        for c in range(4):
            blocks[low, r, c] += w * u[r] * v[c]


@njit(cache=True, nogil=True)
def assemble(t, start, row, product, blocks):  # type: ignore[no-untyped-def]
    """Kernel: factorise the Gauss-Newton matrix at rest, one coordinate's share, into ``blocks``.

    E_rot is 4 w_rot |dR|^2 there, for what stretches; turning is free, but the matrix must not know about
    turning, which couples the coordinates, so it is braked like stretching. L-BFGS finds out.
    """
    blocks[:] = 0.0
    forth, back, none = np.zeros(4), np.zeros(4), np.zeros(4)
    unit = np.eye(4)
    for j in range(start.shape[0] - 1):
        for c in range(3):
            blocks[start[j], c, c] += 4 * t.weights[ROT]
        for c in range(4):
            blocks[start[j], c, c] += _TIKHONOV
    for e in range(t.edges.shape[0]):
        i, j = t.edges[e, 0], t.edges[e, 1]
        forth[:3], forth[3] = t.offsets[e], 1.0
        back[:3], back[3] = -t.offsets[e], 1.0
        none[3] = -1.0
        for first, second, a, b in ((forth, none, i, j), (back, none, j, i)):
            _couple(blocks, start, row, a, b, first, second, t.weights[REG])
    for m in range(t.rigid.shape[0]):
        e = t.rigid[m]
        j, k = t.edges[e, 0], t.edges[e, 1]
        for c in range(3):
            _couple(blocks, start, row, j, k, unit[c], -unit[c], t.weights[RIG])
        forth[:3], forth[3] = 0.5 * t.turning * t.offsets[e], 1.0
        back[:3], back[3] = 0.5 * t.turning * t.offsets[e], -1.0
        _couple(blocks, start, row, j, k, forth, back, t.weights[RIG])
    for m in range(t.nodes.shape[0]):
        w = t.weights[CON] * t.pulls[m]
        if w > 0.0:
            for a in range(4):
                for b in range(4):
                    if t.rows[m, a, 3] != 0.0 and t.rows[m, b, 3] != 0.0:
                        i, j = t.nodes[m, a], t.nodes[m, b]
                        _add(blocks, start, row, i, j, t.rows[m, a], t.rows[m, b], w)
    return factorise(start, row, product, blocks)


@njit(cache=True, nogil=True)
def _couple(blocks, start, row, i, j, u, v, w):  # type: ignore[no-untyped-def]
    """Add w (u; v)(u; v)ᵀ at the nodes i and j."""
    _add(blocks, start, row, i, i, u, u, w)
    _add(blocks, start, row, j, j, v, v, w)
    _add(blocks, start, row, i, j, u, v, w)
    _add(blocks, start, row, j, i, v, u, w)


@njit(cache=True, nogil=True, fastmath=True)
def _dot(u, v):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(u.shape[0]):
        total += u[i] * v[i]
    return total


@njit(cache=True, nogil=True, fastmath=True)
def _add_scaled(u, scale, v):  # type: ignore[no-untyped-def]
    for i in range(u.shape[0]):
        u[i] += scale * v[i]


@njit(cache=True, nogil=True, fastmath=True)
def _set_scaled(u, scale, v):  # type: ignore[no-untyped-def]
    for i in range(u.shape[0]):
        u[i] = scale * v[i]


@njit(cache=True, nogil=True)
def solve_frame(x, rest, t, start, row, blocks, memory, most, tolerance):  # type: ignore[no-untyped-def]
    """Kernel: minimise the energy from ``x``, in place; returns the number of iterations.

    No node is left inside out: where the descent ends with one, it is set upright and the descent goes on.
    """
    if choose_start(x, rest, t, memory.room[0], memory.room[1]):
        memory.kept[0] = 0
    done = descend(x, t, start, row, blocks, memory, most, tolerance)
    for _ in range(2):
        if not set_upright(x, t.edges):
            return done
        memory.kept[0] = 0
        done += descend(x, t, start, row, blocks, memory, most, tolerance)
    set_upright(x, t.edges)
    return done


@njit(cache=True, nogil=True)
def descend(x, t, start, row, blocks, memory, most, tolerance):  # type: ignore[no-untyped-def]
    """Kernel: L-BFGS from ``x``, in place, until little is promised; returns the number of iterations.

    What it remembers is kept from frame to frame: the energy's shape changes less than its minimum.
    """
    room, steps, changes = memory.room, memory.steps, memory.changes
    now, before, way = room[0].reshape(-1), room[1].reshape(-1), room[2].reshape(-1)
    energy = gradient(x, t, room[0])
    for iteration in range(most):
        slope = _direction(now, memory, start, row, blocks, room[2])
        if not slope < 0.0 or -slope <= tolerance * energy[4] + _NEGLIGIBLE:
            return iteration
        step = best_step(along_line(x, room[2], t))
        if step == 0.0:
            return iteration
        _add_scaled(x.reshape(-1), step, way)
        _set_scaled(before, 1.0, now)
        energy = gradient(x, t, room[0])
        slot = memory.kept[0] % _PAIRS
        _set_scaled(steps[slot], step, way)
        _set_scaled(changes[slot], 1.0, now)
        _add_scaled(changes[slot], -1.0, before)
        curvature = _dot(steps[slot], changes[slot])
        if curvature > 1e-12 * abs(slope) * step:
            memory.curvatures[slot] = curvature
            memory.kept[0] += 1
        else:
            # The slot's old pair is gone, and with it the order of the others.
            memory.kept[0] = 0
    return most


@njit(cache=True, nogil=True)
def _direction(now, memory, start, row, blocks, out):  # type: ignore[no-untyped-def]
    """``out`` takes where to go; returns the slope there. What is remembered goes where it misleads."""
    way = out.reshape(-1)
    _two_loops(now, memory, start, row, blocks, out)
    slope = _dot(now, way)
    if not slope < 0.0 and memory.kept[0] > 0:
        memory.kept[0] = 0
        _two_loops(now, memory, start, row, blocks, out)
        slope = _dot(now, way)
    return slope


@njit(cache=True, nogil=True)
def _two_loops(now, memory, start, row, blocks, out):  # type: ignore[no-untyped-def]
    """The two loops of L-BFGS (J. Nocedal 1980) around the solve with the constant factor."""
    way, kept = out.reshape(-1), memory.kept[0]
    _set_scaled(way, -1.0, now)
    share = np.zeros(_PAIRS)
    oldest = max(0, kept - _PAIRS)
    for n in range(kept - 1, oldest - 1, -1):
        m = n % _PAIRS
        share[m] = _dot(memory.steps[m], way) / memory.curvatures[m]
        _add_scaled(way, -share[m], memory.changes[m])
    substitute(start, row, blocks, out)
    _set_scaled(way, 0.5, way)
    for n in range(oldest, kept):
        m = n % _PAIRS
        _add_scaled(way, share[m] - _dot(memory.changes[m], way) / memory.curvatures[m], memory.steps[m])
