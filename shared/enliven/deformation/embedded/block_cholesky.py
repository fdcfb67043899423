"""Sparse Cholesky factorisation in 6x6 blocks: the pattern analysed once, the numbers in every frame.

One node of a deformation graph is one block (its turn and its shift), so the index work is a 36th of a scalar
factorisation's, and everything that depends on the pattern alone (order, fill, where each product goes) is
done beforehand. Blocks are float32, six rows of eight lanes, so that a row is one vector register
(:mod:`enliven.lanes`); a product of two blocks takes 10 to 15 ns where plain Numba loops took 60 to 95.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, identity
from scipy.sparse.linalg import splu

from enliven.arrays import Int, Int32
from enliven.kernels import njit
from enliven.lanes import fma8, load8, splat8, store8, transpose6

SIZE = 48
"""Numbers of a stored block: six rows of eight, the last two of each row 0."""


@dataclass(frozen=True)
class BlockPattern:
    """Where the blocks of the factor L are, column by column (rows ascending, the diagonal block first).

    Attributes:
        start: (N + 1,) int32 where each column starts.
        row: (B,) int32 the row of each block.
        product: (P,) int32 for each column in turn, for each of its lower blocks j, for each i >= j: the
            block (i, j) that takes their product.
    """

    start: Int32
    row: Int32
    product: Int32

    @property
    def blocks(self) -> int:
        """How many 6x6 blocks the factor has."""
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
    """The block pattern of the Cholesky factor, with the nodes eliminated in the order 0, 1, 2, ...

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
        j, i = np.triu_indices(len(lower) - 1)
        products.append(np.stack([lower[1:][i], lower[1:][j]], 1))
    return replace(pattern, product=pattern.block_of(np.concatenate(products)))


@njit(cache=True, nogil=True)
def factorise(start, row, product, lower, upper):  # type: ignore[no-untyped-def]
    """Kernel: A = L Lᵀ. ``lower`` (48 B,) holds A's lower blocks, then those of L, with the inverse of each
    diagonal block of L in its place; ``upper`` takes the transposed blocks. Returns whether A was positive
    definite.
    """
    p = np.int64(0)
    for column in range(start.shape[0] - 1):
        first, last = start[column], start[column + 1]
        if not invert_factor(lower[SIZE * first : SIZE * first + SIZE]):
            return False
        transpose6(lower, SIZE * first, upper, SIZE * first)
        for b in range(first + 1, last):
            times(lower, SIZE * b, upper, SIZE * first)
            transpose6(lower, SIZE * b, upper, SIZE * b)
        for d in range(first + 1, last):
            p = _take_products(lower, upper, product, p, d, last)
    return True


@njit(cache=True, nogil=True)
def _take_products(lower, upper, product, p, first, last):  # type: ignore[no-untyped-def]
    """Take b firstᵀ off the block of each pair, for the blocks b from ``first`` on to the end of its column;
    the six rows of the transposed ``first`` stay in registers. Returns the next of ``product``.
    """
    at = SIZE * first
    a, b, c = load8(upper, at), load8(upper, at + 8), load8(upper, at + 16)
    d, e, f = load8(upper, at + 24), load8(upper, at + 32), load8(upper, at + 40)
    for block in range(SIZE * first, SIZE * last, SIZE):
        target = SIZE * product[p]
        p += 1
        for r in range(0, SIZE, 8):
            left = block + r
            s = fma8(-lower[left], a, load8(lower, target + r))
            s = fma8(-lower[left + 1], b, s)
            s = fma8(-lower[left + 2], c, s)
            s = fma8(-lower[left + 3], d, s)
            s = fma8(-lower[left + 4], e, s)
            s = fma8(-lower[left + 5], f, s)
            store8(lower, target + r, s)
    return p


@njit(cache=True, nogil=True)
def times(lower, target, upper, right):  # type: ignore[no-untyped-def]
    """target = target right, where the rows of ``right`` stand in ``upper``."""
    a, b, c = load8(upper, right), load8(upper, right + 8), load8(upper, right + 16)
    d, e, f = load8(upper, right + 24), load8(upper, right + 32), load8(upper, right + 40)
    for r in range(0, SIZE, 8):
        s = fma8(lower[target + r + 1], b, splat8(lower[target + r]) * a)
        s = fma8(lower[target + r + 3], d, fma8(lower[target + r + 2], c, s))
        s = fma8(lower[target + r + 5], f, fma8(lower[target + r + 4], e, s))
        store8(lower, target + r, s)


@njit(cache=True, nogil=True)
def invert_factor(a):  # type: ignore[no-untyped-def]
    """Replace the symmetric block ``a`` (48,) by the inverse of its lower Cholesky factor.

    Only the lower half of ``a`` is read.
    """
    one = np.float32(1.0)
    for j in range(6):
        total = a[9 * j]
        for m in range(j):
            total -= a[8 * j + m] * a[8 * j + m]
        if not total > 0.0:
            return False
        # One division a column: the rest are products with the inverse of the root.
        inverse = one / np.sqrt(total)
        a[9 * j] = inverse
        for i in range(j + 1, 6):
            total = a[8 * i + j]
            for m in range(j):
                total -= a[8 * i + m] * a[8 * j + m]
            a[8 * i + j] = total * inverse
    for j in range(6):
        for i in range(j + 1, 6):
            total = np.float32(0.0)
            for m in range(j, i):
                total -= a[8 * i + m] * a[8 * m + j]
            a[8 * i + j] = total * a[9 * i]
        for i in range(j):
            a[8 * i + j] = 0.0
    return True


@njit(cache=True, nogil=True)
def substitute(start, row, lower, upper, y):  # type: ignore[no-untyped-def]
    """Kernel: solve L Lᵀ y = b in place, ``y`` (8 N,): six numbers a node, and two 0."""
    count = start.shape[0] - 1
    zero = splat8(np.float32(0.0))
    for k in range(count):
        store8(y, 8 * k, _weighted(upper, SIZE * start[k], y, 8 * k, zero, zero))
        a, b, c = -y[8 * k], -y[8 * k + 1], -y[8 * k + 2]
        d, e, f = -y[8 * k + 3], -y[8 * k + 4], -y[8 * k + 5]
        for block in range(SIZE * (start[k] + 1), SIZE * start[k + 1], SIZE):
            at = 8 * row[block // SIZE]
            even = fma8(a, load8(upper, block), load8(y, at))
            odd = splat8(b) * load8(upper, block + 8)
            even = fma8(c, load8(upper, block + 16), even)
            odd = fma8(d, load8(upper, block + 24), odd)
            even = fma8(e, load8(upper, block + 32), even)
            odd = fma8(f, load8(upper, block + 40), odd)
            store8(y, at, even + odd)
    for k in range(count - 1, -1, -1):
        even, odd = zero, zero
        for b in range(start[k] + 1, start[k + 1]):
            at, block = 8 * row[b], SIZE * b
            even = fma8(y[at], load8(lower, block), even)
            odd = fma8(y[at + 1], load8(lower, block + 8), odd)
            even = fma8(y[at + 2], load8(lower, block + 16), even)
            odd = fma8(y[at + 3], load8(lower, block + 24), odd)
            even = fma8(y[at + 4], load8(lower, block + 32), even)
            odd = fma8(y[at + 5], load8(lower, block + 40), odd)
        store8(y, 8 * k, load8(y, 8 * k) - even - odd)
        store8(y, 8 * k, _weighted(lower, SIZE * start[k], y, 8 * k, zero, zero))


@njit(cache=True, nogil=True)
def _weighted(blocks, block, y, at, even, odd):  # type: ignore[no-untyped-def]
    """``even``, ``odd`` and the sum of the block's rows, weighted with y[at : at + 6]; two sums at once keep
    the processor from waiting for either.
    """
    for m in range(0, 6, 2):
        even = fma8(y[at + m], load8(blocks, block + 8 * m), even)
        odd = fma8(y[at + m + 1], load8(blocks, block + 8 * m + 8), odd)
    return even + odd
