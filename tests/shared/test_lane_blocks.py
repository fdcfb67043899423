"""Tests of 6x6 blocks in vector registers against NumPy."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from enliven.lane_blocks import invert6, loadshort8, mirror6, shorten6, totals6, transpose6
from enliven.lanes import load8, store8

seeds = st.integers(0, 2**32 - 1)


@njit
def transposed(source, at, target, to):
    transpose6(source, at, target, to)


@njit
def mirrored(source, target, sign):
    mirror6(source, 3, target, 5, sign)


@njit
def inverted(block, at, sign):
    return invert6(block, at, sign)


@njit
def summed(x, out):
    a, b, c = load8(x, 0), load8(x, 8), load8(x, 16)
    store8(out, 0, totals6(a, b, c, load8(x, 24), load8(x, 32), load8(x, 40)))


@njit
def shortened(block, short):
    return shorten6(block, 0, short, 4)


@njit
def lengthened(short, at, out):
    store8(out, 0, loadshort8(short, at))


def in_rows(matrix):
    """Returns (48,) a 6x6 matrix in rows of eight."""
    block = np.zeros((6, 8), np.float32)
    block[:, :6] = matrix
    return block.ravel()


def test_transposing_a_block_changes_only_it():
    source = np.arange(100, dtype=np.float32)
    target = np.full(100, -1, np.float32)
    transposed(source, 3, target, 40)
    block = source[3:51].reshape(6, 8)[:, :6]
    np.testing.assert_array_equal(target[40:88].reshape(6, 8)[:, :6], block.T)
    np.testing.assert_array_equal(target[40:88].reshape(6, 8)[:, 6:], 0)
    assert (target[:40] == -1).all() and (target[88:] == -1).all()


def test_a_lower_half_is_mirrored():
    source, target = np.arange(60, dtype=np.float32), np.full(60, 7, np.float32)
    mirrored(source, target, np.float32(-1.0))
    lower = np.tril(source[3:51].reshape(6, 8)[:, :6])
    np.testing.assert_array_equal(target[5:53], -in_rows(lower + np.tril(lower, -1).T))
    assert (target[:5] == 7).all() and (target[53:] == 7).all()


@settings(deadline=None, max_examples=50)
@given(seeds, st.sampled_from([1.0, -1.0]), st.floats(1e-3, 1e3))
def test_a_definite_block_is_inverted(seed, sign, size):
    m = np.random.default_rng(seed).normal(size=(6, 6))
    matrix = sign * size * (m @ m.T + 0.1 * np.eye(6))
    block = np.concatenate([np.full(4, 7, np.float32), in_rows(matrix), np.full(4, 7, np.float32)])
    assert inverted(block, 4, np.float32(sign))
    inverse = block[4:52].reshape(6, 8)
    # Single precision, of a condition of up to a thousand.
    expected = np.linalg.inv(matrix)
    np.testing.assert_allclose(inverse[:, :6], expected, atol=1e-3 * np.abs(expected).max())
    assert (inverse[:, 6:] == 0).all() and (block[:4] == 7).all() and (block[52:] == 7).all()


@settings(deadline=None, max_examples=50)
@given(seeds, st.integers(0, 5))
def test_indefinite_block_is_reported(seed, which):
    turned = np.linalg.qr(np.random.default_rng(seed).normal(size=(6, 6)))[0]
    eigenvalues = np.linspace(1.0, 2.0, 6)
    eigenvalues[which] = -0.5
    block = in_rows(turned @ np.diag(eigenvalues) @ turned.T)
    assert not inverted(block.copy(), 0, np.float32(1.0))
    assert not inverted(block.copy(), 0, np.float32(-1.0))


@settings(deadline=None, max_examples=20)
@given(seeds)
def test_six_registers_are_summed_at_once(seed):
    x, out = np.random.default_rng(seed).normal(size=48).astype("f4"), np.zeros(8, "f4")
    summed(x, out)
    np.testing.assert_allclose(out, [*x.reshape(6, 8).sum(1), 0, 0], atol=1e-5)


@settings(deadline=None, max_examples=50)
@given(seeds, st.sampled_from([0.0, 1e-12, 1.0, 1e6]))
def test_a_block_is_shortened_to_half_a_step_of_its_greatest_number(seed, size):
    block = in_rows(size * np.random.default_rng(seed).normal(size=(6, 6)))
    short, out = np.full(50, 7, np.int16), np.zeros(8, "f4")
    scale = shortened(block, short)
    rows = block.reshape(6, 8)[:, :6]
    most = np.abs(rows).max()
    np.testing.assert_allclose(scale * short[4:40], rows.ravel(), atol=0.501 * most / 32767 + 1e-30)
    lengthened(short, 4, out)
    np.testing.assert_array_equal(out, short[4:12])
    # Two numbers behind it are the last row's free lanes; nothing else is touched.
    assert (short[:4] == 7).all() and (short[40:42] == 0).all() and (short[42:] == 7).all()
