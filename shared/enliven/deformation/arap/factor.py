"""A sparse Cholesky factor for many solves with three right-hand sides. Its supernodes are stored in float32
for vector registers.

SciPy's SuperLU finds the order (multiple minimum degree) and factorizes once. Columns with the same pattern
are collected in supernodes. Narrow supernodes are merged if that adds few zeros. A supernode is a dense
panel, cut into blocks of four columns. So its indices are read only once, and each row needs four
multiplications into one register of x, y, z. The triangle on the diagonal is stored as its inverse, which
avoids the latency of divisions. Values are float32, because the solver only computes corrections, and the
next iteration removes their rounding errors.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix
from scipy.sparse.linalg import splu

from enliven.arrays import Float, Float32, Int, Int32
from enliven.kernels import njit

_MAX_SUPERNODE_COLUMNS = 64
"""Maximum number of columns of a supernode. The size of its inverted triangle grows with the square."""
_FEW_ZEROS = 0.25
"""Maximum fraction of stored zeros in a panel for which a supernode is merged with its parent. More zeros
cost more multiplications than the merged indices save."""


class Factor(NamedTuple):
    """The Cholesky factor C of a matrix A = C Cᵀ, in elimination order, with S supernodes.

    Attributes:
        order: (V,) the vertex that is eliminated at each position.
        first: (S + 1,) the first column of each supernode.
        row_start: (S + 1,) the index in ``rows`` at which its rows below the diagonal begin.
        rows: (R,) the rows below the diagonal of each supernode, ascending.
        value_start: (S + 1,) the index in ``values`` at which its panel begins.
        values: blocks of four columns (the last one padded with zeros): the inverted triangle, then the rows
            below, four numbers per row. A single column is not padded.
        parent: (S,) the supernode that contains its first row below the diagonal; -1 for the root.
        node_of: (V,) the supernode of each column.
        tallest: the number of rows of the tallest panel.
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
    """Returns the factor of the Laplacian of weighted edges, with vertex 0 fixed.

    Fixing one vertex does not restrict the result, because the solver adds a translation of the whole surface
    (:mod:`enliven.deformation.arap.handles`).

    Args:
        count: V vertices, all in one connected component.
        edges: (E, 2) pairs of vertices, each once.
        weights: (E,) the weights of the edges, above 0.
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
    decomposition = splu(
        matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    lower = decomposition.L.tocsc()
    lower.sort_indices()
    scale = np.sqrt(decomposition.U.diagonal())
    start, row = lower.indptr.astype(np.int64), lower.indices.astype(np.int32)
    value = lower.data * np.repeat(scale, np.diff(start))
    first, last_of = _find_supernodes(start, row)
    return _build_panels(np.argsort(decomposition.perm_c), start, row, value, first, last_of)


@njit(cache=True, nogil=True)
def _find_supernodes(start, row):
    """Returns (S + 1,) the first column of each supernode, and S. A supernode is merged with its parent if
    that adds few zeros.
    """
    count = len(start) - 1
    first = np.empty(count + 1, np.int32)
    entries = np.empty(count, np.int64)
    size = 0
    for c in range(count):
        first[size], entries[size] = c, start[c + 1] - start[c]
        size += 1
        first[size] = c + 1
        # The previous supernode is a child of this supernode if its first row below the diagonal belongs to
        # this supernode.
        while size > 1:
            child = first[size - 1] - 1
            if start[child + 1] - start[child] < 2 or row[start[child] + 1] != first[size - 1]:
                break
            width = first[size] - first[size - 2]
            below = start[first[size]] - start[first[size] - 1] - 1
            dense = width * (width + 1) // 2 + width * below
            real = entries[size - 2] + entries[size - 1]
            if width > _MAX_SUPERNODE_COLUMNS or (dense - real > _FEW_ZEROS * dense and width > 4):
                break
            size -= 1
            first[size] = c + 1
            entries[size - 1] = real
    return first[: size + 1].copy(), size


def _build_panels(order: Int, start: Int, row: Int32, value: Float, first: Int32, size: int) -> Factor:
    """Returns the factor, given the columns in CSC form: builds the supernodes' rows and dense panels."""
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
    _fill_panels(start, row, value, first, row_start, value_start, rows, values)
    parent = np.full(size, -1, np.int32)
    has = below > 0
    parent[has] = node_of[rows[row_start[:-1][has]]]
    tallest = int((width + below).max(initial=1))
    del count
    return Factor(
        np.asarray(order, np.int64), first, row_start, rows, value_start, values, parent, node_of, tallest
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _fill_panels(start, row, value, first, row_start, value_start, rows, values):
    """Copies the columns of the factor into the dense panels of supernodes. Inverts each panel's triangle."""
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
