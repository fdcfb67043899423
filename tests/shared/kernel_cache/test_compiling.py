"""Tests that compilations of the process are reported, and that garbage collection waits for their end."""

import gc
import itertools

import numba
import pytest

import enliven.kernels  # noqa: F401  (it registers the listener)
from enliven.kernel_cache import compiling
from enliven.kernel_cache.compiling import watch_compilation


def test_compilations_are_counted_from_start_to_end():
    @numba.njit
    def inner(x):
        return x + 1

    @numba.njit
    def outer(x):
        return inner(x)

    counts = []
    with watch_compilation(counts.append):
        outer(1)
        outer(2)
    outer(2.5)
    assert [count - counts[0] for count in counts] == [0, 0], "outer began, then inner, and neither had ended"
    with watch_compilation(counts.append):
        outer(2j)
    assert counts[2] - counts[0] == 4, "the complex outer began when both had ended twice"


@pytest.mark.parametrize("enabled", [True, False])
def test_garbage_is_collected_after_compiling_as_before(enabled):
    during = []
    try:
        gc.enable() if enabled else gc.disable()
        with watch_compilation(lambda count: during.append(gc.isenabled())):
            numba.njit(lambda x: x * 2)(1)
        assert during and not any(during)
        assert gc.isenabled() is enabled
    finally:
        gc.enable()


def test_a_kernel_that_cannot_be_compiled_leaves_garbage_collection_on():
    with pytest.raises(numba.TypingError):
        numba.njit(lambda x: x.no_such_attribute)(1)
    assert gc.isenabled()
    numba.njit(lambda x: x * 3)(1)
    assert gc.isenabled()


@pytest.mark.parametrize(
    ("seconds", "shows_progress", "lines"), [(1.0, False, 0), (3.0, False, 1), (3.0, True, 0)]
)
def test_long_wait_for_compilation_is_explained_once(monkeypatch, caplog, seconds, shows_progress, lines):
    """Three functions are compiled, and then a fourth. Each takes this number of seconds."""
    clock = itertools.count(step=seconds)
    monkeypatch.setattr(compiling.time, "perf_counter", lambda: next(clock))
    compilations = compiling.CompilationCounter()
    if shows_progress:
        compilations.callbacks.append(lambda count: None)
    caplog.set_level("INFO")
    for _ in range(4):
        compilations.on_start(None)
        compilations.on_end(None)
    assert caplog.text.count("compiling kernels; this takes one or two minutes") == lines
