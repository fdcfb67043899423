"""Sparse factorization A = L D Lᵀ in 6x6 blocks: one symbolic analysis, numeric factorization on demand.

One node of a deformation graph is one block (its rotation and its translation), so the work for indices is a
36th of the work in a scalar factorization. Everything that depends only on the pattern (order, fill, target
of each product) is computed in advance. L has identity blocks on its diagonal, and D consists of blocks. So
the work for a node does not wait for a division by another node's block. During factorization, a block has
float32 numbers in six rows of eight lanes, so that a row is one vector register (:mod:`enliven.lane_blocks`).
A product of two blocks takes 10 to 15 ns, compared with 60 to 95 ns in plain Numba loops.

Solving is limited by memory bandwidth: a matrix of 1,024 nodes is larger than a core's cache. So L is stored
row by row, in int16 with one scale per block (resolution 1.5e-5 of the block's largest number; any L keeps
the matrix positive definite). Each of the two passes reads all of it once. The second pass reads backwards,
so that it starts with the data that are still in the cache.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Int, Int32
from enliven.kernels import njit
from enliven.lane_blocks import invert6, loadshort8, mirror6, shorten6, totals6, transpose6
from enliven.lanes import fma8, load8, splat8, store8

SIZE = 48
"""Count of numbers in a block during factorization: six rows of eight. The last two numbers of each row are
0."""
SOLVING_SIZE = 36
"""Count of numbers in a block during solving: six rows of six int16 numbers. They are stored compactly
because solving is limited by memory bandwidth."""


@dataclass(frozen=True)
class BlockPattern:
    """The positions of the blocks of the factor L, column by column. The diagonal block of a column comes
    first, then its rows ascending.

    Attributes:
        start: (N + 1,) int32 the index at which each column starts.
        row: (B,) int32 the row of each block.
        product: (P,) int32 the block (i, j) that receives each product: for each column in turn, for each of
            its blocks j below the diagonal, for each i >= j.
        row_start: (N + 1,) int32 the index at which each row starts among the blocks below the diagonal, row
            by row.
        column: (B - N,) int32 the column of each block below the diagonal, ascending in a row.
        by_row: (B,) int32 the index of each block in ``column``; -1 for a block on the diagonal.
    """

    start: Int32
    row: Int32
    product: Int32
    row_start: Int32
    column: Int32
    by_row: Int32

    @property
    def blocks(self) -> int:
        """Number of 6x6 blocks of the factor."""
        return len(self.row)

    @property
    def max_blocks_per_column(self) -> int:
        """Maximum number of blocks in a column."""
        return int(np.diff(self.start).max())

    def block_of(self, pairs: Int) -> Int32:
        """Returns the number (M,) of the block at each (row, column) of ``pairs`` (M, 2), with row >=
        column.
        """
        column = np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))
        block_keys = column.astype(np.int64) * len(self.start) + self.row
        pair_keys = pairs[:, 1].astype(np.int64) * len(self.start) + pairs[:, 0]
        return np.searchsorted(block_keys, pair_keys).astype(np.int32)


def elimination_order(count: int, pairs: Int) -> Int:
    """Returns the nodes (N,) in an elimination order with little fill-in (minimum degree).

    Args:
        count: the number of nodes.
        pairs: (M, 2) the pairs of coupled nodes.
    """
    is_coupled = np.zeros((count, count), np.bool_)
    is_coupled[pairs[:, 0], pairs[:, 1]] = is_coupled[pairs[:, 1], pairs[:, 0]] = True
    np.fill_diagonal(is_coupled, False)
    return np.asarray(_minimum_degree_order(is_coupled))


@njit(cache=True, nogil=True)
def _minimum_degree_order(is_coupled):
    """Returns the nodes in minimum degree order: each step eliminates the node with the fewest neighbours.
    Overwrites ``is_coupled`` (N, N).

    SuperLU's multiple minimum degree leaves as many blocks. But SciPy, which contains it, is slow to load.
    """
    count = is_coupled.shape[0]
    degree, order = np.zeros(count, np.int64), np.empty(count, np.int64)
    is_left, neighbours = np.ones(count, np.bool_), np.empty(count, np.int64)
    for i in range(count):
        for j in range(count):
            degree[i] += is_coupled[i, j]
    for k in range(count):
        node = -1
        for i in range(count):
            if is_left[i] and (node < 0 or degree[i] < degree[node]):
                node = i
        order[k], is_left[node], size = node, False, 0
        for i in range(count):
            if is_coupled[node, i]:
                neighbours[size] = i
                size += 1
        # Eliminating a node couples all its neighbours.
        for m in range(size):
            a = neighbours[m]
            is_coupled[a, node] = False
            degree[a] -= 1
            for n in range(size):
                b = neighbours[n]
                if a != b and not is_coupled[a, b]:
                    is_coupled[a, b] = True
                    degree[a] += 1
    return order


def find_block_pattern(count: int, pairs: Int) -> BlockPattern:
    """Returns the block pattern of the Cholesky factor, with the nodes eliminated in the order 0, 1, 2, ...

    Args:
        count: N, the number of nodes.
        pairs: (M, 2) the pairs of coupled nodes, in any order. Duplicates are allowed.
    """
    rows_below: list[set[int]] = [set() for _ in range(count)]
    for a, b in np.unique(np.sort(pairs, 1), axis=0).tolist():
        if a != b:
            rows_below[a].add(b)
    for node in range(count):
        if rows_below[node]:
            # Eliminating a node couples all its neighbours. Record the couplings only at the neighbour that
            # is eliminated next. Its own elimination passes them on.
            next_node = min(rows_below[node])
            rows_below[next_node] |= rows_below[node] - {next_node}
    rows = [np.array([node, *sorted(rows_below[node])]) for node in range(count)]
    start = np.concatenate([[0], np.cumsum([len(node_rows) for node_rows in rows])])
    row = np.concatenate(rows).astype(np.int32)
    column = np.repeat(np.arange(count, dtype=np.int32), np.diff(start))
    # A stable sort keeps the columns of each row in ascending order.
    off_diagonal = np.flatnonzero(row != column)
    off_diagonal = off_diagonal[np.argsort(row[off_diagonal], kind="stable")]
    by_row = np.full(len(row), -1, np.int32)
    by_row[off_diagonal] = np.arange(len(off_diagonal))
    row_start = np.searchsorted(row[off_diagonal], np.arange(count + 1)).astype(np.int32)
    none = np.empty(0, np.int32)
    pattern = BlockPattern(start.astype(np.int32), row, none, row_start, column[off_diagonal], by_row)
    products = []
    for lower in rows:
        j, i = np.triu_indices(len(lower) - 1)
        products.append(np.stack([lower[1:][i], lower[1:][j]], 1))
    return replace(pattern, product=pattern.block_of(np.concatenate(products)))


@njit(cache=True, nogil=True)
def factorise(pattern, lower, column, rows, scales, inverse):
    """Factorizes the matrix A = L D Lᵀ. Returns True if A is positive definite.

    Args:
        pattern: the fields start, product and by_row of a :class:`BlockPattern`.
        lower: (48 B,) the blocks of A on and below the diagonal, column by column. They are overwritten. Of a
            diagonal block only the lower half is read.
        column: (48 C,) scratch space for the blocks of the longest column.
        rows, scales: (36 (B - N) + 8,) int16, (B - N,) output: the blocks of L below the diagonal, row by
            row.
        inverse: (48 N,) output: the inverses of the blocks of D.
    """
    start, product, by_row = pattern
    p, block = np.int64(0), np.zeros(SIZE, np.float32)
    for k in range(start.shape[0] - 1):
        first, last, diagonal_place = start[k], start[k + 1], SIZE * k
        mirror6(lower, SIZE * first, inverse, diagonal_place, 1.0)
        if not invert6(inverse, diagonal_place, 1.0):
            return False
        for b in range(first + 1, last):
            multiply_blocks(lower, SIZE * b, inverse, diagonal_place, block, 0)
            transpose6(block, 0, column, SIZE * (b - first))
            place = SOLVING_SIZE * by_row[b]
            # Writing the block also overwrites two numbers of the next block, which may be complete already.
            # So save and restore these numbers.
            saved_first, saved_second = rows[place + SOLVING_SIZE], rows[place + SOLVING_SIZE + 1]
            scales[by_row[b]] = shorten6(block, 0, rows, place)
            rows[place + SOLVING_SIZE], rows[place + SOLVING_SIZE + 1] = saved_first, saved_second
        p = _subtract_products(lower, column, product, p, first, last)
    return True


@njit(cache=True, nogil=True)
def _subtract_products(lower, column, product, p, first, last):
    """Subtracts the product b Lᵀ from the block of each pair of a column's blocks. b is a block of A, and L
    is a block of the factor.

    L is stored transposed in ``column``. The rows of Lᵀ stay in registers. Returns the next index in
    ``product``.
    """
    for at in range(SIZE, SIZE * (last - first), SIZE):
        a, b, c = load8(column, at), load8(column, at + 8), load8(column, at + 16)
        d, e, f = load8(column, at + 24), load8(column, at + 32), load8(column, at + 40)
        for block in range(SIZE * first + at, SIZE * last, SIZE):
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
def multiply_blocks(left, at, right, there, out, to):
    """Computes the product of the block at ``at`` of ``left`` and the block at ``there`` of ``right``, into
    ``out`` at ``to``.
    """
    a, b, c = load8(right, there), load8(right, there + 8), load8(right, there + 16)
    d, e, f = load8(right, there + 24), load8(right, there + 32), load8(right, there + 40)
    for r in range(0, SIZE, 8):
        s = fma8(left[at + r + 1], b, splat8(left[at + r]) * a)
        s = fma8(left[at + r + 3], d, fma8(left[at + r + 2], c, s))
        s = fma8(left[at + r + 5], f, fma8(left[at + r + 4], e, s))
        store8(out, to + r, s)


@njit(cache=True, nogil=True)
def substitute(row_start, column, rows, scales, inverse, y):
    """Solves L D Lᵀ y = b in place. ``y`` (8 N,) has six numbers per node, and two zeros.

    A row of six numbers is read as eight, so its last two lanes contain numbers of the next row. In the
    forward pass, they are multiplied by the two zeros of a node. In the backward pass, they are added to
    lanes that are set to 0 before a node is read.
    """
    count = row_start.shape[0] - 1
    zero = splat8(np.float32(0.0))
    for i in range(count):
        a, b, c, d, e, f = zero, zero, zero, zero, zero, zero
        for k in range(row_start[i], row_start[i + 1]):
            at, there = SOLVING_SIZE * k, splat8(scales[k]) * load8(y, 8 * column[k])
            a, b = fma8(loadshort8(rows, at), there, a), fma8(loadshort8(rows, at + 6), there, b)
            c, d = fma8(loadshort8(rows, at + 12), there, c), fma8(loadshort8(rows, at + 18), there, d)
            e, f = fma8(loadshort8(rows, at + 24), there, e), fma8(loadshort8(rows, at + 30), there, f)
        store8(y, 8 * i, load8(y, 8 * i) - totals6(a, b, c, d, e, f))
    for i in range(count):
        store8(y, 8 * i, weighted_row_sum(inverse, SIZE * i, y, 8 * i))
    for i in range(count - 1, -1, -1):
        y[8 * i + 6] = y[8 * i + 7] = 0.0
        a, b, c = -y[8 * i], -y[8 * i + 1], -y[8 * i + 2]
        d, e, f = -y[8 * i + 3], -y[8 * i + 4], -y[8 * i + 5]
        for k in range(row_start[i], row_start[i + 1]):
            at, to = SOLVING_SIZE * k, 8 * column[k]
            even = fma8(c, loadshort8(rows, at + 12), splat8(a) * loadshort8(rows, at))
            odd = fma8(d, loadshort8(rows, at + 18), splat8(b) * loadshort8(rows, at + 6))
            both = fma8(e, loadshort8(rows, at + 24), even) + fma8(f, loadshort8(rows, at + 30), odd)
            store8(y, to, fma8(scales[k], both, load8(y, to)))


@njit(cache=True, nogil=True)
def weighted_row_sum(blocks, block, y, at):
    """Returns the sum of the six rows of a block, weighted with y[at : at + 6].

    Two sums in parallel hide the latency of the additions.
    """
    even = splat8(y[at]) * load8(blocks, block)
    odd = splat8(y[at + 1]) * load8(blocks, block + 8)
    even = fma8(y[at + 2], load8(blocks, block + 16), even)
    odd = fma8(y[at + 3], load8(blocks, block + 24), odd)
    return fma8(y[at + 4], load8(blocks, block + 32), even) + fma8(y[at + 5], load8(blocks, block + 40), odd)
