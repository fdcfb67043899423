"""Functions that only kernels call have no entry point, until Python calls them."""

import subprocess
import sys
import threading

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba.core import serialize

from enliven.kernel_cache.callees import KernelDispatcher, is_callee
from enliven.kernels import njit


def make_kernels():
    """Returns a kernel, its callee and the callee of this one, none of them compiled."""

    @njit()
    def root(x):
        if x < 0.0:
            raise ValueError("no root of a negative number")
        return np.sqrt(x)

    @njit()
    def scaled_roots(values, factor):
        out = np.empty(values.shape[0])
        for i in range(values.shape[0]):
            out[i] = factor * root(values[i])
        return out

    @njit()
    def total(values):
        return scaled_roots(values, 3.0).sum()

    return total, scaled_roots, root


def list_variants(kernel):
    return list(kernel.overloads.values())


def test_a_callee_is_compiled_without_an_entry_point():
    total, scaled_roots, root = make_kernels()
    assert total(np.array([1.0, 4.0])) == 9.0
    assert not is_callee(list_variants(total)[0])
    for callee in (scaled_roots, root):
        assert isinstance(callee, KernelDispatcher)
        assert [is_callee(variant) for variant in list_variants(callee)] == [True]


def test_a_callee_has_no_entry_point_for_c():
    @numba.njit
    def callee(x):
        return x + 1.0

    @numba.njit
    def kernel(x):
        return callee(x)

    assert kernel(1.0) == 2.0
    (variant,) = list_variants(callee)
    assert "cfunc." not in variant.library.get_llvm_str()
    (variant,) = list_variants(kernel)
    assert "cfunc." in variant.library.get_llvm_str(), "Numba still names these entry points in this way"


def test_python_can_call_a_callee_later():
    total, scaled_roots, root = make_kernels()
    total(np.ones(2))
    np.testing.assert_array_equal(scaled_roots(np.array([4.0, 9.0]), 3.0), [6.0, 9.0])
    assert root(16.0) == 4.0
    assert [is_callee(variant) for variant in list_variants(scaled_roots)] == [False]
    assert total(np.array([4.0])) == 6.0, "kernels that include the callee still run"


def test_a_function_that_python_called_first_is_included_as_well():
    total, _, root = make_kernels()
    assert root(4.0) == 2.0
    assert total(np.array([1.0, 4.0])) == 9.0
    assert [is_callee(variant) for variant in list_variants(root)] == [False]


def test_an_error_of_a_callee_reaches_python():
    total, _, root = make_kernels()
    for _ in range(2):
        with pytest.raises(ValueError, match="no root of a negative number"):
            total(np.array([1.0, -1.0]))
    with pytest.raises(ValueError, match="no root of a negative number"):
        root(-1.0)


def test_an_error_with_a_number_of_a_callee_reaches_python():
    @njit()
    def check(x):
        if x > 3:
            raise ValueError("too large", x)
        return x

    @njit()
    def checked_sum(count):
        total = 0
        for x in range(count):
            total += check(x)
        return total

    assert checked_sum(3) == 3
    with pytest.raises(ValueError) as caught:
        checked_sum(9)
    assert caught.value.args == ("too large", 4)


def test_other_argument_types_of_a_callee_are_separate_variants():
    total, _, root = make_kernels()
    total(np.ones(2))
    assert root(np.float32(4.0)) == 2.0
    assert [is_callee(variant) for variant in list_variants(root)] == [True, False]
    assert root(4.0) == 2.0
    assert not any(map(is_callee, list_variants(root)))


def test_threads_that_compile_at_the_same_time_get_entry_points():
    """A thread that waits for the compiler is not a callee of another thread's kernel."""
    kernels = [make_kernels() for _ in range(4)]
    results = []
    threads = [
        threading.Thread(
            target=lambda k=k: results.append(kernels[k][k % 2](*[np.ones(3), 3.0][: 1 + k % 2]))
        )
        for k in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(float(np.sum(result)) for result in results) == [9.0] * 4
    assert not any(is_callee(list_variants(kernels[k][k % 2])[0]) for k in range(4))


def test_a_function_that_fails_to_compile_does_not_change_the_next_one():
    @njit()
    def wrong(x):
        return x.no_such_attribute

    @njit()
    def caller(x):
        return wrong(x)

    with pytest.raises(numba.core.errors.TypingError):
        caller(1.0)
    root = make_kernels()[2]
    assert root(4.0) == 2.0
    assert not is_callee(list_variants(root)[0])


@pytest.mark.parametrize("signature", ["f8(f8)", numba.float64(numba.float64), (numba.float64,)])
def test_other_packages_may_give_a_signature(signature):
    """The class of compiled functions is also used for functions of other packages."""
    increment = numba.njit(signature)(lambda x: x + 1.0)
    assert isinstance(increment, KernelDispatcher)
    assert increment(2.0) == 3.0


def test_a_function_can_be_sent_to_another_process():
    command = "import sys, pickle, enliven.kernels; print(pickle.load(sys.stdin.buffer)(2.0))"
    data = serialize.dumps(numba.njit(lambda x: x + 1.0))
    done = subprocess.run([sys.executable, "-c", command], input=data, capture_output=True, check=True)
    assert done.stdout.split() == [b"3.0"]


@pytest.fixture(scope="module")
def filters():
    """Returns a kernel with a callee as enliven compiles it, and as Numba does."""

    def decay(x, past, rate):
        return rate * x + (1.0 - rate) * past

    def smooth(values, rate):
        out = np.zeros_like(values)
        past = 0.0
        for i in range(values.shape[0]):
            past = decay_function(values[i], past, rate)
            out[i] = past * past - values[i] / 3.0
        return out

    compiled = []
    for decorate in (njit(), numba.core.registry.CPUDispatcher):
        wrap = decorate if decorate is not numba.core.registry.CPUDispatcher else plain_njit
        decay_function = wrap(decay)
        compiled.append(wrap(with_global(smooth, decay_function)))
    return compiled


def plain_njit(function):
    return numba.core.registry.CPUDispatcher(function, targetoptions={"nopython": True})


def with_global(function, decay_function):
    """Returns a copy of a function with its own closure."""
    cell = (lambda: decay_function).__closure__[0]
    return type(function)(
        function.__code__, function.__globals__, function.__name__, function.__defaults__, (cell,)
    )


@given(st.lists(st.floats(-1e6, 1e6), max_size=20), st.floats(0.0, 1.0))
def test_results_are_those_of_plain_numba(filters, values, rate):
    """LLVM optimises a callee once instead of twice, which must not change one bit."""
    ours, plain = filters
    np.testing.assert_array_equal(ours(np.array(values), rate), plain(np.array(values), rate))
