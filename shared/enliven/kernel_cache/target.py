"""The processor that kernels are compiled for: a named level instead of the exact host processor."""

from __future__ import annotations

import platform

import llvmlite.binding
import numba.core.config
from numba.core.registry import cpu_target

_LEVELS = {
    "x86-64-v3": ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"),
    "x86-64-v2": ("cx16", "popcnt", "sse3", "sse4.1", "sse4.2", "ssse3"),
}
"""Processor features that each x86-64 level needs, by LLVM's names, best level first.

See the x86-64 psABI, section 3.1.1. Level 4 (AVX-512) is left out: LLVM uses 256-bit vectors there as well.
"""
_ARM = "generic"
"""LLVM's name for ARMv8-A with Neon, which every 64-bit ARM processor has."""


def processor_levels() -> tuple[str, ...]:
    """Returns LLVM's names of this processor's levels, best first; empty for other architectures."""
    machine = platform.machine().lower()
    if machine in ("aarch64", "arm64"):
        return (_ARM,)
    if machine not in ("x86_64", "amd64"):
        return ()
    features = llvmlite.binding.get_host_cpu_features()
    return tuple(level for level, needs in _LEVELS.items() if all(features.get(name) for name in needs))


def choose_target() -> None:
    """Sets the best level of this processor as the target of all kernels that this process compiles.

    Does nothing if ``NUMBA_CPU_NAME`` or ``NUMBA_CPU_FEATURES`` asks for another target, if the processor has
    no level, or if Numba has already compiled code for the host processor. A process has only one target.
    """
    config = numba.core.config
    if config.CPU_NAME is not None or config.CPU_FEATURES is not None:
        return
    levels = processor_levels()
    if levels and "_toplevel_target_context" not in vars(cpu_target):
        config.CPU_NAME, config.CPU_FEATURES = levels[0], ""
