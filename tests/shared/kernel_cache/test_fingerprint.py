"""Tests that a kernel's fingerprint depends on exactly those inputs that affect its machine code."""

import itertools
import linecache
import os
import subprocess
import sys
import types

import pytest

from enliven.kernel_cache.fingerprint import fingerprint

SOURCE = '''
"""Words."""
import math
from collections import namedtuple
from enum import IntEnum

import numpy as np
from numba import types
from numba.extending import intrinsic

from enliven.kernels import njit
from enliven import rotation

SCALE = 2.0
TABLE = np.array([1.0, 2.0])
NESTED = ((1, 2.5), "word")
Pair = namedtuple("Pair", "a b")


def reach(limit):
    @njit(cache=True)
    def inner(x):
        return min(x, limit)

    return inner


clip = reach(5.0)


@intrinsic
def one(context):
    return types.float64(), lambda context, builder, signature, args: context.get_constant(types.float64, 1.0)


@njit(cache=True, nogil=True)
def helper(x, power=2):
    return x ** power


@njit(cache=True)
def neighbour(x):
    return x - 1.0


@njit(cache=True, nogil=True)
def kernel(x):
    """Words of the kernel."""
    # A comment.
    total = helper(x) * SCALE + TABLE[0] + NESTED[0][1] + LATER + one()
    if x in {3, 5, 7}:
        total = clip(total)
    return Pair(math.sqrt(total), sum([y for y in (1, 2)]))


LATER = 4.0
'''

CHANGES = {
    "a constant": ("SCALE = 2.0", "SCALE = 3.0"),
    "the type of a constant": ("SCALE = 2.0", "SCALE = 2"),
    "a constant below the kernel": ("LATER = 4.0", "LATER = 5.0"),
    "a global array": ("[1.0, 2.0]", "[1.5, 2.0]"),
    "a value in a nested tuple": ("(1, 2.5)", "(1, 3.5)"),
    "the fields of a named tuple": ('"a b"', '"b a"'),
    "a kernel that it calls": ("x ** power", "x ** (power + 1)"),
    "a default of a kernel that it calls": ("power=2", "power=3"),
    "compiler options of a kernel that it calls": (
        "@njit(cache=True, nogil=True)\ndef helper",
        "@njit(cache=True, nogil=True, fastmath=True)\ndef helper",
    ),
    "a value in the closure of a kernel that it calls": ("reach(5.0)", "reach(6.0)"),
    "an intrinsic": ("types.float64, 1.0)", "types.float64, 2.0)"),
    "its code": ("total = clip(total)", "total = clip(x)"),
    "a member of a set": ("{3, 5, 7}", "{3, 5, 9}"),
    "a comprehension inside it": ("(1, 2)]", "(1, 3)]"),
}
SAME = {
    "docstrings": ("Words of the kernel.", "Other words."),
    "comments": ("# A comment.", "# Another comment.\n    # And a third."),
    "lines above": ('"""Words."""', '"""Words."""\n\n\n'),
    "another kernel of the file": ("x - 1.0", "x - 2.0"),
    "the name of a local variable": ("total", "amount"),
}
NAMES = itertools.count()


def fingerprint_of(source: str) -> str:
    """Returns the fingerprint of ``kernel`` in a module with this source."""
    file = f"<kernels {next(NAMES)}>"
    module = types.ModuleType("kernels_of_a_test")
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    exec(compile(source, file, "exec"), vars(module))
    return fingerprint(module.kernel.py_func)


@pytest.fixture(scope="module")
def expected() -> str:
    return fingerprint_of(SOURCE)


@pytest.mark.parametrize("change", CHANGES)
def test_the_fingerprint_changes_with(change, expected):
    before, after = CHANGES[change]
    assert SOURCE.count(before) == 1
    assert fingerprint_of(SOURCE.replace(before, after)) != expected


@pytest.mark.parametrize("change", SAME)
def test_the_fingerprint_does_not_change_with(change, expected):
    before, after = SAME[change]
    assert before in SOURCE
    assert fingerprint_of(SOURCE.replace(before, after)) == expected


def test_a_kernel_that_calls_itself_has_a_fingerprint():
    source = SOURCE + "\n\n@njit(cache=True)\ndef kernel(n):\n    return 1 if n < 2 else n * kernel(n - 1)\n"
    assert fingerprint_of(source) == fingerprint_of(source)
    assert fingerprint_of(source) != fingerprint_of(source.replace("n < 2", "n < 3"))


ORDERED = """
from enliven.kernels import njit

@njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def inner(x):
    return x in {"a", "b", "c"}

@njit(cache=True)
def kernel(x):
    return inner(x)

print(inner._cache._file_stem, kernel._cache._file_stem)
"""


@pytest.mark.slow
def test_names_of_kernels_do_not_depend_on_the_order_of_sets(tmp_path):
    """Each process iterates over sets in its own order. Cached files whose names depended on it would never
    be found.
    """
    (tmp_path / "ordered.py").write_text(ORDERED)
    names = {
        subprocess.run(
            [sys.executable, "ordered.py"],
            cwd=tmp_path,
            env={**os.environ, "PYTHONHASHSEED": str(seed)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in (1, 2, 3, 4)
    }
    assert len(names) == 1
