"""Triangular solves with the Cholesky factor of :mod:`enliven.deformation.arap.factor`. One vector register
contains x, y and z."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven.lanes import fmaq, loadq, splatq, storeq


@njit(cache=True, nogil=True)
def solve_forward(factor, z, room):
    """Replaces z by C⁻¹ z.

    Args:
        z: (4 (V + 4),) float32, x, y, z, 0 of each position; the last four positions are scratch space.
        room: (4 (tallest + 4),) float32 scratch space.
    """
    first, row_start, rows, values = factor.first, factor.row_start, factor.rows, factor.values
    for s in range(len(first) - 1):
        a, width = first[s], first[s + 1] - first[s]
        r0, below = row_start[s], row_start[s + 1] - row_start[s]
        height = width + below
        if width == 1:
            # Fast path: most supernodes (the leaves of the elimination tree) have a single column.
            at = factor.value_start[s]
            t = fmaq(-values[at], loadq(z, 4 * a), splatq(np.float32(0.0)))
            storeq(z, 4 * a, splatq(np.float32(0.0)) - t)
            for k in range(below):
                to = 4 * rows[r0 + k]
                storeq(z, to, fmaq(values[at + 1 + k], t, loadq(z, to)))
            continue
        for r in range(height):
            storeq(room, 4 * r, splatq(np.float32(0.0)))
        # Multiply by the inverse of the triangular diagonal block of the supernode.
        for block in range((width + 3) // 4):
            at = factor.value_start[s] + 4 * block * height
            c = 4 * (a + 4 * block)
            # The padding columns contain zeros. They are only multiplied with finite numbers, so they add
            # nothing.
            t0, t1, t2, t3 = loadq(z, c), loadq(z, c + 4), loadq(z, c + 8), loadq(z, c + 12)
            for r in range(4 * block, width):
                v = loadq(room, 4 * r)
                p = at + 4 * r
                v = fmaq(values[p], t0, v)
                v = fmaq(values[p + 1], t1, v)
                v = fmaq(values[p + 2], t2, v)
                storeq(room, 4 * r, fmaq(values[p + 3], t3, v))
        for k in range(width):
            storeq(z, 4 * (a + k), loadq(room, 4 * k))
        # Multiply by the rows below, and subtract the result from the later entries of z.
        for block in range((width + 3) // 4):
            at = factor.value_start[s] + 4 * block * height
            c = 4 * (a + 4 * block)
            t0, t1, t2, t3 = loadq(z, c), loadq(z, c + 4), loadq(z, c + 8), loadq(z, c + 12)
            for r in range(width, height):
                v = loadq(room, 4 * r)
                p = at + 4 * r
                v = fmaq(values[p], t0, v)
                v = fmaq(values[p + 1], t1, v)
                v = fmaq(values[p + 2], t2, v)
                storeq(room, 4 * r, fmaq(values[p + 3], t3, v))
        for k in range(below):
            to = 4 * rows[r0 + k]
            storeq(z, to, loadq(z, to) - loadq(room, 4 * (width + k)))


@njit(cache=True, nogil=True)
def solve_backward(factor, z, room):  # noqa: PLR0915, a kernel
    """Replaces z by C⁻ᵀ z. The arguments are those of :func:`solve_forward`."""
    first, row_start, rows, values = factor.first, factor.row_start, factor.rows, factor.values
    for s in range(len(first) - 2, -1, -1):
        a, width = first[s], first[s + 1] - first[s]
        r0, below = row_start[s], row_start[s + 1] - row_start[s]
        height = width + below
        if width == 1:
            at = factor.value_start[s]
            t0 = t1 = splatq(np.float32(0.0))
            for k in range(0, below - 1, 2):
                t0 = fmaq(values[at + 1 + k], loadq(z, 4 * rows[r0 + k]), t0)
                t1 = fmaq(values[at + 2 + k], loadq(z, 4 * rows[r0 + k + 1]), t1)
            if below % 2:
                t0 = fmaq(values[at + below], loadq(z, 4 * rows[r0 + below - 1]), t0)
            storeq(z, 4 * a, fmaq(values[at], loadq(z, 4 * a) - (t0 + t1), splatq(np.float32(0.0))))
            continue
        for k in range(below):
            storeq(room, 4 * (width + k), loadq(z, 4 * rows[r0 + k]))
        # Subtract the product with the transposed rows below the diagonal.
        for block in range((width + 3) // 4):
            at = factor.value_start[s] + 4 * block * height
            c = 4 * block
            t0 = t1 = t2 = t3 = splatq(np.float32(0.0))
            for r in range(width, height):
                v = loadq(room, 4 * r)
                p = at + 4 * r
                t0 = fmaq(values[p], v, t0)
                t1 = fmaq(values[p + 1], v, t1)
                t2 = fmaq(values[p + 2], v, t2)
                t3 = fmaq(values[p + 3], v, t3)
            storeq(room, 4 * c, loadq(z, 4 * (a + c)) - t0)
            if c + 1 < width:
                storeq(room, 4 * (c + 1), loadq(z, 4 * (a + c + 1)) - t1)
            if c + 2 < width:
                storeq(room, 4 * (c + 2), loadq(z, 4 * (a + c + 2)) - t2)
            if c + 3 < width:
                storeq(room, 4 * (c + 3), loadq(z, 4 * (a + c + 3)) - t3)
        # Multiply by the transpose of the inverted triangle on the diagonal.
        for block in range((width + 3) // 4):
            at = factor.value_start[s] + 4 * block * height
            c = 4 * block
            t0 = t1 = t2 = t3 = splatq(np.float32(0.0))
            for r in range(c, width):
                v = loadq(room, 4 * r)
                p = at + 4 * r
                t0 = fmaq(values[p], v, t0)
                t1 = fmaq(values[p + 1], v, t1)
                t2 = fmaq(values[p + 2], v, t2)
                t3 = fmaq(values[p + 3], v, t3)
            storeq(z, 4 * (a + c), t0)
            if c + 1 < width:
                storeq(z, 4 * (a + c + 1), t1)
            if c + 2 < width:
                storeq(z, 4 * (a + c + 2), t2)
            if c + 3 < width:
                storeq(z, 4 * (a + c + 3), t3)


@njit(cache=True, nogil=True)
def _panel_index(factor, s, width, height, r, c):
    """Returns the index in ``factor.values`` of the value in row r and column c of the panel of supernode
    s."""
    return factor.value_start[s] + (r if width == 1 else 4 * ((c // 4) * height + r) + c % 4)


@njit(cache=True, nogil=True)
def solve_for_unit_vector(factor, place):
    """Computes C⁻¹ e for the unit vector e at ``place``: (K,) its non-zero positions, ascending, and (K,)
    their values.

    Only the supernodes on the path from this position to the root are needed.
    """
    first, row_start, rows, values = factor.first, factor.row_start, factor.rows, factor.values
    length, s = 0, factor.node_of[place]
    while s >= 0:
        length += first[s + 1] - first[s]
        s = factor.parent[s]
    places, column = np.empty(length, np.int32), np.empty(length)
    work = np.zeros(len(factor.order))
    work[place] = 1.0
    size, s = 0, factor.node_of[place]
    while s >= 0:
        a, width = first[s], first[s + 1] - first[s]
        height = width + row_start[s + 1] - row_start[s]
        for r in range(width):
            total = 0.0
            for c in range(r + 1):
                total += values[_panel_index(factor, s, width, height, r, c)] * work[a + c]
            places[size + r], column[size + r] = a + r, total
        for r in range(width, height):
            total = 0.0
            for c in range(width):
                total += values[_panel_index(factor, s, width, height, r, c)] * column[size + c]
            work[rows[row_start[s] + r - width]] -= total
        size += width
        s = factor.parent[s]
    return places, column
