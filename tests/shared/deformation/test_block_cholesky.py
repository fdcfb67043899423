"""Tests of the block Cholesky factor against dense linear algebra."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.deformation.embedded.block_cholesky import (
    elimination_order,
    factorise,
    find_block_pattern,
    substitute,
)


def dense_of(pattern, lower):
    """Returns (6N, 6N) the symmetric matrix with the lower blocks (48 B,)."""
    count = len(pattern.start) - 1
    blocks = lower.reshape(-1, 6, 8)[:, :, :6]
    out = np.zeros((count, 6, count, 6))
    for column in range(count):
        for b in range(pattern.start[column], pattern.start[column + 1]):
            out[pattern.row[b], :, column] = blocks[b]
            out[column, :, pattern.row[b]] = blocks[b].T
    return out.reshape(6 * count, 6 * count)


def random_system(count, density, seed):
    """Returns a positive definite matrix with random couplings, as lower blocks of the pattern and as a dense
    matrix.
    """
    rng = np.random.default_rng(seed)
    pairs = np.argwhere(np.tri(count, k=-1) * (rng.random((count, count)) < density))
    pattern = find_block_pattern(count, pairs)
    blocks = np.zeros((pattern.blocks, 6, 8), np.float32)
    own = pattern.block_of(np.stack([np.arange(count)] * 2, 1))
    for block in own:
        m = rng.normal(size=(6, 6))
        blocks[block, :, :6] = m @ m.T + 6 * count * np.eye(6)
    if len(pairs):
        blocks[pattern.block_of(pairs), :, :6] = rng.normal(size=(len(pairs), 6, 6))
    return pattern, blocks.reshape(-1), dense_of(pattern, blocks.reshape(-1))


def factor_of(pattern, blocks):
    """Returns True if the blocks could be factorised, and the factor."""
    count = len(pattern.start) - 1
    column, inverse = (
        np.zeros(48 * pattern.max_blocks_per_column, np.float32),
        np.zeros(48 * count, np.float32),
    )
    scales = np.zeros(len(pattern.column), np.float32)
    rows = np.full(36 * len(pattern.column) + 8, 7, np.int16)
    which = pattern.start, pattern.product, pattern.by_row
    return factorise(which, blocks, column, rows, scales, inverse), (rows, scales, inverse)


@settings(deadline=None, max_examples=40)
@given(st.integers(1, 15), st.floats(0, 1), st.integers(0, 2**32 - 1))
def test_solution_matches_numpy(count, density, seed):
    pattern, blocks, dense = random_system(count, density, seed)
    right = np.random.default_rng(seed).normal(size=(count, 6))
    is_factored, factor = factor_of(pattern, blocks)
    assert is_factored
    x = np.zeros((count, 8), np.float32)
    x[:, :6] = right
    substitute(pattern.row_start, pattern.column, *factor, x.reshape(-1))
    expected = np.linalg.solve(dense, right.reshape(-1)).reshape(-1, 6)
    np.testing.assert_allclose(x[:, :6], expected, rtol=1e-3, atol=1e-4 * np.abs(expected).max())
    assert (x[:, 6:] == 0).all()


def test_indefinite_matrix_is_reported():
    pattern = find_block_pattern(2, np.array([[1, 0]]))
    blocks = np.zeros(3 * 48, np.float32)
    assert not factor_of(pattern, blocks)[0]


def test_the_order_keeps_the_fill_of_a_grid_low():
    side = 16
    n = np.arange(side * side).reshape(side, side)
    pairs = np.concatenate(
        [np.stack([n[:-1].ravel(), n[1:].ravel()], 1), np.stack([n[:, :-1].ravel(), n[:, 1:].ravel()], 1)]
    )
    order = elimination_order(side * side, pairs)
    assert sorted(order) == list(range(side * side))
    place = np.argsort(order)
    rng = np.random.default_rng(0).permutation(side * side)
    assert (
        find_block_pattern(side * side, place[pairs]).blocks
        < 0.4 * find_block_pattern(side * side, rng[pairs]).blocks
    )


@pytest.mark.parametrize("count", [1, 3])
def test_uncoupled_nodes_are_solved(count):
    pattern = find_block_pattern(count, np.empty((0, 2), int))
    assert pattern.blocks == count
    assert sorted(elimination_order(count, np.empty((0, 2), int))) == list(range(count))
