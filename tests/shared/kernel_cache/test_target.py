"""Tests that kernels are compiled for the best level of the processor, or for the one that the user sets."""

import os
import subprocess
import sys

import llvmlite.binding
import pytest

from enliven.kernel_cache import target
from enliven.kernel_cache.target import processor_levels

V2 = dict.fromkeys(("cx16", "popcnt", "sse3", "sse4.1", "sse4.2", "ssse3"), True)
V3 = V2 | dict.fromkeys(("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"), True)
REPORT = """
{first}
import enliven.kernels
from numba.core.registry import cpu_target
print(cpu_target.target_context.codegen().magic_tuple()[1])
"""
COMPILE = "import numba\nnumba.njit(lambda x: x + 1)(1)"


@pytest.mark.parametrize(
    ("machine", "features", "expected"),
    [
        ("x86_64", V3, ("x86-64-v3", "x86-64-v2")),
        ("AMD64", V3 | {"avx2": False}, ("x86-64-v2",)),
        ("x86_64", V2, ("x86-64-v2",)),
        ("x86_64", {"sse3": True}, ()),
        ("aarch64", {}, ("generic",)),
        ("arm64", {}, ("generic",)),
        ("riscv64", {}, ()),
    ],
)
def test_levels_of_a_processor(monkeypatch, machine, features, expected):
    monkeypatch.setattr(target.platform, "machine", lambda: machine)
    monkeypatch.setattr(llvmlite.binding, "get_host_cpu_features", lambda: features)
    assert processor_levels() == expected


def target_of(first: str = "", **environment: str) -> str:
    """Returns the target processor of a separate process."""
    words = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_CPU")}
    command = [sys.executable, "-c", REPORT.format(first=first)]
    done = subprocess.run(command, env=words | environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.skipif(not processor_levels(), reason="this processor has no named level")
def test_a_process_compiles_for_the_best_level():
    assert target_of() == processor_levels()[0]


def test_the_user_may_ask_for_another_processor():
    assert target_of(NUMBA_CPU_NAME="generic") == "generic"


def test_a_process_that_has_compiled_keeps_its_processor():
    """Numba compiles for one target per process, so the reported name must not change afterwards."""
    assert target_of(COMPILE) == llvmlite.binding.get_host_cpu_name()
