"""A sparse Cholesky factor for many solves with three right-hand sides: supernodes, float32, registers.

SciPy's SuperLU orders (multiple minimum degree) and factorises once. Its columns that share their pattern are
gathered into supernodes; narrow ones are merged where few zeros come in. A supernode is a dense panel, cut
into blocks of four columns, so that its indices are read once and a row is four multiplications into one
register of x, y, z. The triangle on the diagonal is stored inverted: no division, no waiting for the one
before. Values are float32: the solver asks for corrections, whose error the next iteration takes back.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, types
from scipy.sparse import coo_matrix, csc_matrix
from scipy.sparse.linalg import splu

from enliven.arrays import Float, Float32, Int, Int32
from enliven.lanes import Lanes, _make_fma, _make_load, _make_splat, _make_store

QUAD = Lanes(4, types.float32)
loadq, storeq, splatq, fmaq = (make(QUAD) for make in (_make_load, _make_store, _make_splat, _make_fma))
_WIDEST = 64
_FEW_ZEROS = 0.25


class Factor(NamedTuple):
    """C with C Cᵀ = A, in elimination order; S supernodes.

    Attributes:
        order: (V,) the vertex eliminated at each place.
        first: (S + 1,) the first column of each supernode.
        row_start: (S + 1,) where its rows below the diagonal begin in ``rows``.
        rows: (R,) ascending.
        value_start: (S + 1,) where its panel begins in ``values``.
        values: blocks of four columns (the last one padded with zeros): the inverted triangle, then the rows
            below, four numbers a row. A single column is not padded.
        parent: (S,) the supernode of its first row below; -1 at the root.
        node_of: (V,) the supernode of each column.
        tallest: the most rows of a panel.
    """

    order: Int
    first: Int32
    row_start: Int
    rows: Int32
    value_start: Int
    values: Float32
    parent: Int32
    node_of: Int32
    tallest: int


def factorise(count: int, edges: Int, weights: Float) -> Factor:
    """The factor of the edges' Laplacian with its vertex 0 held.

    Holding one vertex takes away nothing: the solver adds a shift of the whole (see arap_handles).

    Args:
        count: V vertices, all of them in one piece.
        edges: (E, 2), each once.
        weights: (E,) above 0.
    """
    a, b = edges[:, 0], edges[:, 1]
    diagonal = np.bincount(a, weights, count) + np.bincount(b, weights, count)
    diagonal[0] += max(float(diagonal.mean()), 1e-12)
    place = np.arange(count)
    matrix = csc_matrix(
        coo_matrix(
            (
                np.concatenate([-weights, -weights, diagonal]),
                (np.concatenate([a, b, place]), np.concatenate([b, a, place])),
            ),
            (count, count),
        )
    )
    made = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    lower = made.L.tocsc()
    lower.sort_indices()
    scale = np.sqrt(made.U.diagonal())
    start, row = lower.indptr.astype(np.int64), lower.indices.astype(np.int32)
    value = lower.data * np.repeat(scale, np.diff(start))
    first, last_of = _supernodes(start, row)
    return _panels(np.argsort(made.perm_c), start, row, value, first, last_of)


@njit(cache=True, nogil=True)
def _supernodes(start, row):  # type: ignore[no-untyped-def]
    """(S + 1,) the first column of each supernode, merged with its parent where few zeros come in."""
    count = len(start) - 1
    first = np.empty(count + 1, np.int32)
    entries = np.empty(count, np.int64)
    size = 0
    for c in range(count):
        first[size], entries[size] = c, start[c + 1] - start[c]
        size += 1
        first[size] = c + 1
        # The piece before ends where this one begins: it is this one's child where its next row is here.
        while size > 1:
            child = first[size - 1] - 1
            if start[child + 1] - start[child] < 2 or row[start[child] + 1] != first[size - 1]:
                break
            width = first[size] - first[size - 2]
            below = start[first[size]] - start[first[size] - 1] - 1
            dense = width * (width + 1) // 2 + width * below
            real = entries[size - 2] + entries[size - 1]
            if width > _WIDEST or (dense - real > _FEW_ZEROS * dense and width > 4):
                break
            size -= 1
            first[size] = c + 1
            entries[size - 1] = real
    return first[: size + 1].copy(), size


def _panels(order: Int, start: Int, row: Int32, value: Float, first: Int32, size: int) -> Factor:
    """The supernodes' rows and dense panels."""
    count = len(order)
    width = np.diff(first).astype(np.int64)
    last = first[1:].astype(np.int64) - 1
    below = start[last + 1] - start[last] - 1
    row_start = np.concatenate([[0], np.cumsum(below)])
    blocks = (width + 3) // 4
    value_start = np.concatenate([[0], np.cumsum(np.where(width == 1, 1, 4 * blocks) * (width + below))])
    rows = np.empty(row_start[-1], np.int32)
    values = np.zeros(value_start[-1], np.float32)
    node_of = np.repeat(np.arange(size), width).astype(np.int32)
    _fill(start, row, value, first, row_start, value_start, rows, values)
    parent = np.full(size, -1, np.int32)
    has = below > 0
    parent[has] = node_of[rows[row_start[:-1][has]]]
    tallest = int((width + below).max(initial=1))
    del count
    return Factor(
        np.asarray(order, np.int64), first, row_start, rows, value_start, values, parent, node_of, tallest
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _fill(start, row, value, first, row_start, value_start, rows, values):  # type: ignore[no-untyped-def]
    """Scatter the columns into panels, and invert the triangles."""
    count = len(start) - 1
    place = np.zeros(count, np.int64)
    for s in range(len(first) - 1):
        a, b = first[s], first[s + 1]
        width, begin = b - a, start[b - 1] + 1
        below = row_start[s + 1] - row_start[s]
        for k in range(width):
            place[a + k] = k
        for k in range(below):
            rows[row_start[s] + k] = row[begin + k]
            place[row[begin + k]] = width + k
        panel = np.zeros((width + below, width))
        for c in range(a, b):
            for e in range(start[c], start[c + 1]):
                panel[place[row[e]], c - a] = value[e]
        inverse = np.zeros((width, width))
        for c in range(width):
            inverse[c, c] = 1.0 / panel[c, c]
            for r in range(c + 1, width):
                total = 0.0
                for k in range(c, r):
                    total -= panel[r, k] * inverse[k, c]
                inverse[r, c] = total / panel[r, r]
        height = width + below
        for r in range(height):
            for c in range(width):
                to = value_start[s] + (r if width == 1 else 4 * ((c // 4) * height + r) + c % 4)
                values[to] = inverse[r, c] if r < width else panel[r, c]


@njit(cache=True, nogil=True)
def forward(factor, z, room):  # type: ignore[no-untyped-def]
    """z <- C⁻¹ z, in place.

    Args:
        z: (4 (V + 4),) float32, x, y, z, 0 of each place; the last four places are room.
        room: (4 (tallest + 4),) float32.
    """
    first, row_start, rows, values = factor.first, factor.row_start, factor.rows, factor.values
    for s in range(len(first) - 1):
        a, width = first[s], first[s + 1] - first[s]
        r0, below = row_start[s], row_start[s + 1] - row_start[s]
        height = width + below
        if width == 1:
            # Most supernodes, the leaves of the tree, are one column.
            at = factor.value_start[s]
            t = fmaq(-values[at], loadq(z, 4 * a), splatq(np.float32(0.0)))
            storeq(z, 4 * a, splatq(np.float32(0.0)) - t)
            for k in range(below):
                to = 4 * rows[r0 + k]
                storeq(z, to, fmaq(values[at + 1 + k], t, loadq(z, to)))
            continue
        for r in range(height):
            storeq(room, 4 * r, splatq(np.float32(0.0)))
        for block in range((width + 3) // 4):
            at = factor.value_start[s] + 4 * block * height
            c = 4 * (a + 4 * block)
            # The padding's columns are zeros; what they are multiplied with is finite.
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
def backward(factor, z, room):  # type: ignore[no-untyped-def]
    """z <- C⁻ᵀ z, in place; arguments as of :func:`forward`."""
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
def _at(factor, s, width, height, r, c):  # type: ignore[no-untyped-def]
    """Where the value of row r and column c of a panel is."""
    return factor.value_start[s] + (r if width == 1 else 4 * ((c // 4) * height + r) + c % 4)


@njit(cache=True, nogil=True)
def unit_column(factor, place):  # type: ignore[no-untyped-def]
    """C⁻¹ e of the unit vector at ``place``: (K,) its non-zero places, ascending, and (K,) values.

    Only the supernodes on the way from the place to the root take part.
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
                total += values[_at(factor, s, width, height, r, c)] * work[a + c]
            places[size + r], column[size + r] = a + r, total
        for r in range(width, height):
            total = 0.0
            for c in range(width):
                total += values[_at(factor, s, width, height, r, c)] * column[size + c]
            work[rows[row_start[s] + r - width]] -= total
        size += width
        s = factor.parent[s]
    return places, column
