"""Tests of vector registers against NumPy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from numba.core.errors import TypingError

from enliven.lanes import (
    apart8,
    cross4,
    fma4,
    fma8,
    load4,
    load8,
    narrowed4,
    splat4,
    splat8,
    store4,
    store8,
    storeq,
    together8,
    total4,
    total8,
    totals4,
    turned8,
    widened4,
)


@njit
def everything4(x, out, scalar):
    a, b = load4(x, 1), load4(x, 5)
    store4(out, 0, fma4(scalar, a, b))
    store4(out, 4, a * b - splat4(scalar) + a)
    return total4(a)


@njit
def everything8(x, out, scalar):
    a, b = load8(x, 1), load8(x, 9)
    store8(out, 0, fma8(scalar, a, b))
    store8(out, 8, a * b - splat8(scalar) + a)
    return total8(a)


@njit
def summed(x):
    """Sums a register in a loop."""
    total = splat4(0.0)
    for i in range(0, x.shape[0], 4):
        total = total + load4(x, i)
    return total4(total)


@njit
def multiplied8(x, y, out):
    store8(out, 0, fma8(load8(x, 0), load8(y, 0), load8(x, 8)))


@njit
def reordered(x, out):
    store8(out, 0, together8(load8(x, 0)))
    store8(out, 8, apart8(load8(out, 0)))


@njit
def turned(rows, x, out):
    store8(out, 0, turned8(rows, 2, load8(x, 0)))


@njit
def widened(x, out):
    store4(out, 0, widened4(x, 3))


@njit
def crossed(x, out, short):
    a, b, c = load4(x, 0), load4(x, 4), load4(x, 8)
    store4(out, 0, cross4(a, b))
    store4(out, 4, totals4(a, b, c))
    storeq(short, 1, narrowed4(c))


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_cross_products_and_sums_of_three_registers_are_those_of_numpy(seed):
    x, out, short = np.random.default_rng(seed).normal(size=(3, 4)), np.zeros((2, 4)), np.zeros(6, "f4")
    x[:2, 3] = 0.0
    crossed(x.ravel(), out.reshape(-1), short)
    # Sums in another order: their last bits are others.
    np.testing.assert_allclose(out[0], [*np.cross(x[0, :3], x[1, :3]), 0.0], atol=1e-13)
    np.testing.assert_allclose(out[1], [*x.sum(1), 0.0], atol=1e-13)
    np.testing.assert_array_equal(short, np.concatenate([[0.0], x[2], [0.0]]).astype("f4"))


@pytest.mark.parametrize(
    ("kernel", "count", "kind", "close"), [(everything4, 4, float, 1e-12), (everything8, 8, "f4", 1e-5)]
)
@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_registers_reckon_as_numpy_does(kernel, count, kind, close, seed):
    rng = np.random.default_rng(seed)
    x, out = rng.normal(size=1 + 2 * count).astype(kind), np.zeros(2 * count, kind)
    scalar = x.dtype.type(rng.normal())
    total = kernel(x, out, scalar)
    a, b = x[1 : 1 + count], x[1 + count :]
    np.testing.assert_allclose(out, np.concatenate([scalar * a + b, a * b - scalar + a]), atol=10 * close)
    assert total == pytest.approx(a.sum(), abs=10 * close)


@settings(deadline=None, max_examples=20)
@given(st.integers(1, 30), st.integers(0, 2**32 - 1))
def test_a_register_lives_through_a_loop(count, seed):
    x = np.random.default_rng(seed).normal(size=4 * count)
    assert summed(x) == pytest.approx(x.sum())


def test_a_register_times_another_one():
    rng = np.random.default_rng(0)
    x, y, out = rng.normal(size=16).astype("f4"), rng.normal(size=8).astype("f4"), np.zeros(8, "f4")
    multiplied8(x, y, out)
    np.testing.assert_allclose(out, x[:8] * y + x[8:], atol=1e-6)


def test_twice_three_numbers_are_put_together_and_apart_again():
    x, out = np.arange(8, dtype=np.float32), np.zeros(16, np.float32)
    reordered(x, out)
    np.testing.assert_array_equal(out[:6], [0, 1, 2, 4, 5, 6])
    np.testing.assert_array_equal(out[8:], x)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_both_halves_of_a_register_are_turned(seed):
    rng = np.random.default_rng(seed)
    rows, x, out = rng.normal(size=14).astype("f4"), rng.normal(size=8).astype("f4"), np.zeros(8, "f4")
    turned(rows, x, out)
    matrix = rows[2:].reshape(3, 4)
    # Sums of three float32 products of numbers of about 1.
    np.testing.assert_allclose(out, [*(x[:3] @ matrix), *(x[4:7] @ matrix)], atol=1e-5)


def test_single_precision_is_widened():
    x, out = np.linspace(0.0, 1.0, 8, dtype=np.float32), np.zeros(4)
    widened(x, out)
    np.testing.assert_array_equal(out, x[3:7].astype(float))


def test_numbers_of_another_kind_are_refused():
    """Read as another type, the numbers would be meaningless or beyond the end of the array."""
    with pytest.raises(TypingError, match="widened4"):
        widened(np.zeros(8), np.zeros(4))
    with pytest.raises(TypingError, match="load"):
        multiplied8(np.zeros(16), np.zeros(8), np.zeros(8))
