"""The target processor of kernels: a named processor level instead of the exact host processor."""

from __future__ import annotations

import platform

import llvmlite.binding
import numba.core.config
from numba.core.registry import cpu_target

_PROCESSOR_LEVELS = {
    "x86-64-v3": ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"),
    "x86-64-v2": ("cx16", "popcnt", "sse3", "sse4.1", "sse4.2", "ssse3"),
}
"""Processor features (LLVM's names) that each x86-64 level requires, best level first.

See the x86-64 psABI, section 3.1.1. Level 4 (AVX-512) is left out, because LLVM uses 256-bit vectors on it,
too.
"""
ARM_PROCESSOR = "generic"
"""LLVM's name for ARMv8-A with Neon, which every 64-bit ARM processor has."""

_chosen_target: dict[str, bool] = {}
"""The choice of this process. The key ``native`` is True for this exact processor. Empty if no choice was
made.
"""


def processor_levels() -> tuple[str, ...]:
    """Returns LLVM's names of the levels that this processor supports, best first. The result is empty on
    other architectures."""
    machine = platform.machine().lower()
    if machine in ("aarch64", "arm64"):
        return (ARM_PROCESSOR,)
    if machine not in ("x86_64", "amd64"):
        return ()
    features = llvmlite.binding.get_host_cpu_features()
    return tuple(
        level
        for level, needed_features in _PROCESSOR_LEVELS.items()
        if all(features.get(name) for name in needed_features)
    )


def host_processor() -> tuple[str, str]:
    """Returns LLVM's name of this processor, and its list of features: the target of native code."""
    return llvmlite.binding.get_host_cpu_name(), llvmlite.binding.get_host_cpu_features().flatten()


def can_choose_target() -> bool:
    """Returns True if this process may choose its target.

    A process has only one target. It cannot be chosen if ``NUMBA_CPU_NAME`` or ``NUMBA_CPU_FEATURES`` request
    a target, if the processor has no level, or if Numba has already compiled code for the host processor.
    """
    config = numba.core.config
    is_fixed = config.CPU_NAME is not None or config.CPU_FEATURES is not None
    return not is_fixed and bool(processor_levels()) and "_toplevel_target_context" not in vars(cpu_target)


def is_native_session() -> bool:
    """Returns True if :func:`choose_target` has chosen this exact processor."""
    return _chosen_target.get("native", False)


def has_chosen_target() -> bool:
    """Returns True if :func:`choose_target` has chosen a level or this exact processor."""
    return bool(_chosen_target)


def choose_target(*, native: bool) -> None:
    """Sets the target of all kernels of this process, if :func:`can_choose_target` allows it.

    Args:
        native: True for this exact processor, False for the processor's best level.
    """
    if can_choose_target():
        _chosen_target["native"] = native
        name, features = host_processor() if native else (processor_levels()[0], "")
        numba.core.config.CPU_NAME, numba.core.config.CPU_FEATURES = name, features
