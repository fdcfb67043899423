"""Vector registers against NumPy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from enliven.lanes import (
    fma4,
    fma8,
    load4,
    load8,
    splat4,
    splat8,
    store4,
    store8,
    total4,
    total8,
    transpose6,
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
    """A register that lives through a loop."""
    total = splat4(0.0)
    for i in range(0, x.shape[0], 4):
        total = total + load4(x, i)
    return total4(total)


@njit
def transposed(source, at, target, to):
    transpose6(source, at, target, to)


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


def test_a_block_is_transposed_and_nothing_beside_it_is_touched():
    source = np.arange(100, dtype=np.float32)
    target = np.full(100, -1, np.float32)
    transposed(source, 3, target, 40)
    block = source[3:51].reshape(6, 8)[:, :6]
    np.testing.assert_array_equal(target[40:88].reshape(6, 8)[:, :6], block.T)
    np.testing.assert_array_equal(target[40:88].reshape(6, 8)[:, 6:], 0)
    assert (target[:40] == -1).all() and (target[88:] == -1).all()
