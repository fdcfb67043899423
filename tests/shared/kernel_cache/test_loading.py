"""Tests that stored kernels load without Numba's compiler, and that other kernels can be compiled from
them.
"""

import os
import subprocess
import sys

import pytest

from enliven.kernel_cache.loading import HASH_SYMBOLS

KERNELS = """
import numpy as np

from enliven.kernels import njit


@njit(cache=True)
def stored(values):
    if len(values) == 0:
        raise ValueError("no values", 3)
    doubled = 2.0 * values
    return doubled.sum()


@njit(cache=True)
def count_distinct(values):
    return len(set(values))


@njit()
def caller(values):
    return stored(values) + 1.0


VALUES = np.arange(4.0)
"""
COMPILE = "import kernels as k; print(k.stored(k.VALUES), k.count_distinct(k.VALUES))"
LOAD = """
import sys
import kernels as k

print(k.stored(k.VALUES), sum(k.stored.stats.cache_hits.values()))
try:
    k.stored(k.VALUES[:0])
except ValueError as error:
    print(error.args)
print(sorted({"numba.np.linalg", "numba.np.arraymath", "scipy.linalg"} & set(sys.modules)))
"""
LOAD_HASH = """
import kernels as k

print(k.count_distinct(k.VALUES), sum(k.count_distinct.stats.cache_hits.values()))
"""
LINK = """
import kernels as k

print(k.stored(k.VALUES), k.caller(k.VALUES), sum(k.stored.stats.cache_hits.values()))
"""
SYMBOLS = """
import llvmlite.binding

add, names = llvmlite.binding.add_symbol, []
llvmlite.binding.add_symbol = lambda name, address: (names.append(name), add(name, address))

from numba.core.registry import cpu_target
from numba.core.runtime import rtsys

rtsys.initialize(cpu_target.target_context)
assert "NRT_decref" in names or "NRT_Free" in names, names
names.clear()
cpu_target.target_context.refresh()
print(*names)
"""
"""Prints the symbols that Numba defines when it prepares to compile."""


@pytest.fixture
def run(tmp_path):
    """Returns a function that runs code next to the kernels and returns the printed lines."""
    (tmp_path / "kernels.py").write_text(KERNELS)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    def run_code(code: str) -> list[str]:
        command = [sys.executable, "-c", code]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=600
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    return run_code


@pytest.mark.slow
def test_stored_kernels_need_no_compiler_and_can_be_compiled_into_others(run):
    assert run(COMPILE) == ["12.0 4"]
    loaded, error, compilers = run(LOAD)
    assert loaded == "12.0 1", "it was loaded"
    assert error == "('no values', 3)", "a loaded kernel raises its own errors"
    assert compilers == "[]", "nothing was imported that only a compilation needs"
    assert run(LOAD_HASH) == ["4 1"], "it was loaded, and knows Python's hash secret"
    assert run(LINK) == ["12.0 13.0 1"], "a new kernel was compiled from the loaded one"


def test_numba_defines_all_symbols_but_hash_secrets_before_it_prepares_to_compile(run):
    (line,) = run(SYMBOLS)
    others = [name for name in line.split() if not name.encode().startswith(HASH_SYMBOLS)]
    assert not others, "change enliven.kernel_cache.loading: stored kernels may use these symbols"
