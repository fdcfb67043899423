"""Compiles kernels for aarch64 on a machine with another processor: `make release` runs it.

    python scripts/cross_kernels.py FOLDER INTO

``FOLDER`` contains kernels that are compiled for this machine. Each of these files names a function and its
argument types. The same functions are compiled for the same types, and ``INTO`` gets the results.

Numba compiles for the processor that llvmlite reports. This script replaces the report, so Numba's code
generator makes objects for aarch64. They are linked here, but never run.
"""

from __future__ import annotations

import functools
import importlib
import os
import sys
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba.core.config
import zstandard

from enliven.kernel_cache.loading import unpickle_kernel
from enliven.kernel_cache.target import ARM_PROCESSOR

TRIPLE = "aarch64-unknown-linux-gnu"
"""LLVM's name of the platform, as llvmlite reports it on 64-bit ARM Linux. Names of kernel files depend on
it."""

KernelKey = tuple[str, str, str]
"""Module, qualified name in this module, and text of the argument types."""


def choose_arm(folder: Path) -> None:
    """Makes Numba compile for aarch64 in this process, and store kernels in a folder.

    Call it before the first module with kernels is imported.
    """
    llvmlite.binding.initialize_all_targets()
    llvmlite.binding.initialize_all_asmprinters()
    target = llvmlite.binding.Target.from_triple(TRIPLE)
    llvmlite.binding.get_process_triple = lambda: TRIPLE
    llvmlite.binding.Target.from_default_triple = classmethod(lambda kind: target)
    # Numba reads all variables again whenever one changes. That would overwrite a changed configuration.
    os.environ |= {"NUMBA_CPU_NAME": ARM_PROCESSOR, "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(folder)}
    numba.core.config.reload_config()


def list_kernels(folder: Path) -> dict[KernelKey, tuple[Any, ...]]:
    """Returns the argument types of each kernel in a folder. Kernels for several processor levels count
    once."""
    kernels = {}
    for path in sorted(folder.glob("*.kernel")):
        _, descriptor, _, signature, *_ = unpickle_kernel(zstandard.decompress(path.read_bytes()))
        kernels[descriptor.modname, descriptor.qualname, repr(signature.args)] = signature.args
    return kernels


def compile_kernel(key: KernelKey, types: tuple[Any, ...]) -> None:
    """Compiles one kernel. The kernel cache stores it.

    Raises:
        Exception: any error of Numba. A note names the kernel.
    """
    module, name, text = key
    try:
        functools.reduce(getattr, name.split("."), importlib.import_module(module)).compile(types)
    except Exception as error:
        error.add_note(f"{module}.{name}{text} cannot be compiled for aarch64")
        raise


def main(folder: Path, into: Path) -> None:
    """Compiles all kernels of a folder.

    Raises:
        SystemExit: if not every kernel was stored.
    """
    choose_arm(into)
    kernels = list_kernels(folder)
    for key, types in kernels.items():
        compile_kernel(key, types)
    stored = len(list(into.glob("*.kernel")))
    if stored != len(kernels):
        sys.exit(f"{stored} of {len(kernels)} kernels are in {into}: check its free space and permissions")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
