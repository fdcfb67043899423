"""Sparse Cholesky factorisation in 4x4 blocks: the pattern analysed once, the numbers as often as needed.

One node of a deformation graph is one block, so the index work is a sixteenth of a scalar factorisation's,
and everything that depends on the pattern alone (order, fill, where each product goes) is done beforehand.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from scipy.sparse import coo_matrix, csc_matrix, identity
from scipy.sparse.linalg import splu

from enliven.arrays import Float, Int, Int32


@dataclass(frozen=True)
class BlockPattern:
    """Where the blocks of the factor L are, column by column (rows ascending, the diagonal block first).

    Attributes:
        start: (N + 1,) int32 where each column starts.
        row: (B,) int32 the row of each block.
        product: (P,) int32 for each column in turn, for each pair of its lower blocks i >= j: the block
            (i, j) that takes their product.
    """

    start: Int32
    row: Int32
    product: Int32

    @property
    def blocks(self) -> int:
        """How many 4x4 blocks the factor has."""
        return len(self.row)

    def block_of(self, pairs: Int) -> Int32:
        """(M,) the block at (row, column) of each of ``pairs`` (M, 2), row >= column."""
        column = np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))
        keys = column.astype(np.int64) * len(self.start) + self.row
        wanted = pairs[:, 1].astype(np.int64) * len(self.start) + pairs[:, 0]
        return np.searchsorted(keys, wanted).astype(np.int32)


def elimination_order(count: int, pairs: Int) -> Int:
    """(N,) the nodes in an order that keeps the fill low (multiple minimum degree).

    Args:
        count: the number of nodes.
        pairs: (M, 2) the nodes that are coupled.
    """
    ones = np.ones(len(pairs))
    graph = coo_matrix((ones, (pairs[:, 0], pairs[:, 1])), (count, count))
    coupled = ((graph + graph.T) > 0).astype(np.float64)
    dominant = csc_matrix(-coupled + (count + 1.0) * identity(count))
    options = {"SymmetricMode": True}
    factor = splu(dominant, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    return np.asarray(np.argsort(factor.perm_c), np.int64)


def analyse(count: int, pairs: Int) -> BlockPattern:
    """The pattern of the factor of a matrix whose nodes are eliminated in the order 0, 1, 2, ...

    Args:
        count: N, the number of nodes.
        pairs: (M, 2) the nodes that are coupled, in any order, also repeatedly.
    """
    below: list[set[int]] = [set() for _ in range(count)]
    for a, b in np.unique(np.sort(pairs, 1), axis=0).tolist():
        if a != b:
            below[a].add(b)
    for node in range(count):
        if below[node]:
            # Eliminating a node couples all that it was coupled with; its next one passes that on.
            heir = min(below[node])
            below[heir] |= below[node] - {heir}
    rows = [np.array([node, *sorted(below[node])]) for node in range(count)]
    start = np.concatenate([[0], np.cumsum([len(r) for r in rows])])
    row = np.concatenate(rows).astype(np.int32)
    pattern = BlockPattern(start.astype(np.int32), row, np.empty(0, np.int32))
    products = []
    for lower in rows:
        i, j = np.tril_indices(len(lower) - 1)
        products.append(np.stack([lower[1:][i], lower[1:][j]], 1))
    return replace(pattern, product=pattern.block_of(np.concatenate(products)))


@njit(cache=True, nogil=True, fastmath=True)
def factorise(start, row, product, blocks):  # type: ignore[no-untyped-def]
    """Kernel: A = L Lᵀ in place. ``blocks`` (B, 4, 4) holds A's lower blocks, then L's, with the inverse of
    each diagonal block of L in its place. Returns whether A was positive definite.
    """
    p = 0
    for column in range(start.shape[0] - 1):
        first, last = start[column], start[column + 1]
        if not _invert_factor(blocks[first]):
            return False
        inverse = blocks[first]
        for b in range(first + 1, last):
            block = blocks[b]
            for r in range(4):
                # Row r of A_ik Lkk^-T; the columns from the right, so that none is needed again.
                for c in range(3, -1, -1):
                    total = 0.0
                    for m in range(c + 1):
                        total += block[r, m] * inverse[c, m]
                    block[r, c] = total
        for b in range(first + 1, last):
            upper = blocks[b]
            for d in range(first + 1, b + 1):
                lower, target = blocks[d], blocks[product[p]]
                p += 1
                for r in range(4):
                    for c in range(4):
                        target[r, c] -= (
                            upper[r, 0] * lower[c, 0]
                            + upper[r, 1] * lower[c, 1]
                            + upper[r, 2] * lower[c, 2]
                            + upper[r, 3] * lower[c, 3]
                        )
    return True


@njit(cache=True, nogil=True)
def _invert_factor(a):  # type: ignore[no-untyped-def]
    """Replace the symmetric (4, 4) ``a`` by the inverse of its lower Cholesky factor."""
    for j in range(4):
        for i in range(j, 4):
            total = a[i, j]
            for m in range(j):
                total -= a[i, m] * a[j, m]
            if i == j:
                if not total > 0.0:
                    return False
                a[j, j] = np.sqrt(total)
            else:
                a[i, j] = total / a[j, j]
    for j in range(4):
        a[j, j] = 1.0 / a[j, j]
        for i in range(j + 1, 4):
            total = 0.0
            for m in range(j, i):
                total -= a[i, m] * a[m, j]
            a[i, j] = total / a[i, i]
        for i in range(j):
            a[i, j] = 0.0
    return True


@njit(cache=True, nogil=True, fastmath=True)
def substitute(start, row, blocks, x):  # type: ignore[no-untyped-def]
    """Kernel: solve L Lᵀ x = b in place, ``x`` (N, 4, 3): three right-hand sides at once."""
    count = start.shape[0] - 1
    for k in range(count):
        _lower_times(blocks[start[k]], x[k])
        for b in range(start[k] + 1, start[k + 1]):
            block, target = blocks[b], x[row[b]]
            for r in range(4):
                for a in range(3):
                    target[r, a] -= (
                        block[r, 0] * x[k, 0, a]
                        + block[r, 1] * x[k, 1, a]
                        + block[r, 2] * x[k, 2, a]
                        + block[r, 3] * x[k, 3, a]
                    )
    for k in range(count - 1, -1, -1):
        for b in range(start[k] + 1, start[k + 1]):
            block, source = blocks[b], x[row[b]]
            for c in range(4):
                for a in range(3):
                    x[k, c, a] -= (
                        block[0, c] * source[0, a]
                        + block[1, c] * source[1, a]
                        + block[2, c] * source[2, a]
                        + block[3, c] * source[3, a]
                    )
        _upper_times(blocks[start[k]], x[k])


@njit(cache=True, nogil=True, inline="always")
def _lower_times(m, x):  # type: ignore[no-untyped-def]
    """x (4, 3) = M x for a lower triangular M, in place."""
    for a in range(3):
        x[3, a] = m[3, 0] * x[0, a] + m[3, 1] * x[1, a] + m[3, 2] * x[2, a] + m[3, 3] * x[3, a]
        x[2, a] = m[2, 0] * x[0, a] + m[2, 1] * x[1, a] + m[2, 2] * x[2, a]
        x[1, a] = m[1, 0] * x[0, a] + m[1, 1] * x[1, a]
        x[0, a] = m[0, 0] * x[0, a]


@njit(cache=True, nogil=True, inline="always")
def _upper_times(m, x):  # type: ignore[no-untyped-def]
    """x (4, 3) = Mᵀ x for a lower triangular M, in place."""
    for a in range(3):
        x[0, a] = m[0, 0] * x[0, a] + m[1, 0] * x[1, a] + m[2, 0] * x[2, a] + m[3, 0] * x[3, a]
        x[1, a] = m[1, 1] * x[1, a] + m[2, 1] * x[2, a] + m[3, 1] * x[3, a]
        x[2, a] = m[2, 2] * x[2, a] + m[3, 2] * x[3, a]
        x[3, a] = m[3, 3] * x[3, a]


def dense_of(pattern: BlockPattern, blocks: Float) -> Float:
    """(4N, 4N) the symmetric matrix whose lower blocks (B, 4, 4) are given; for tests and diagnosis."""
    count = len(pattern.start) - 1
    out = np.zeros((count, 4, count, 4))
    for column in range(count):
        for b in range(pattern.start[column], pattern.start[column + 1]):
            out[pattern.row[b], :, column] = blocks[b]
            out[column, :, pattern.row[b]] = blocks[b].T
    return out.reshape(4 * count, 4 * count)
