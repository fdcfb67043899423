"""The on-disk cache of machine code: Numba loads kernels from it."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import sys
import warnings
from collections.abc import Iterable, Iterator
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core import types
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaWarning

from enliven.kernel_cache.fingerprint import describe_options, fingerprint
from enliven.kernel_cache.store import load_kernel, save_kernel, user_folder

_VERSIONS = (sys.version_info[:2], numba.__version__, llvmlite.__version__, np.__version__.partition(".")[0])
"""Versions on which byte code, the serialised form of machine code and the code of library functions depend.

NumPy's code is not compiled into kernels, and the layout of its arrays changes with a major version at most.
"""


def keep(kernel: Any) -> Any:
    """Lets the machine code of a kernel outlive the process.

    Returns:
        The same kernel. If ``NUMBA_DISABLE_JIT`` is set, it is a plain function and returned unchanged.
    """
    if isinstance(kernel, Dispatcher):
        kernel._cache = KernelCache(kernel)
    return kernel


class KernelCache(_Cache):  # type: ignore[misc]
    """Loads and saves the machine code of one kernel, a file for each combination of argument types."""

    def __init__(self, kernel: Any) -> None:
        self._kernel = kernel

    @functools.cached_property
    def _stem(self) -> str:
        """The kernel's name, and a hash of everything that its code depends on except the argument types.

        It is computed at the first call, because globals that are defined after the kernel in its file do not
        exist earlier.
        """
        function = self._kernel.py_func
        parts = fingerprint(function), describe_options(self._kernel), repr(_VERSIONS)
        return f"{function.__name__}-{_hash(parts)}"

    def file_name(self, signature: Any, codegen: Any) -> str:
        """Returns the file name of the machine code for argument types on Numba's current processor level."""
        parts = repr(signature), repr(list(_fields(signature))), repr(codegen.magic_tuple())
        return f"{self._stem}-{_hash(parts)}.kernel"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Returns the compiled kernel for argument types, or None if no folder has it."""
        target_context.refresh()
        with contextlib.suppress(Exception):  # Machine code that cannot be loaded is compiled again.
            data = load_kernel(self.file_name(sig, target_context.codegen()))
            return None if data is None else CompileResult._rebuild(target_context, *data)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Saves a compiled kernel, unless the code contains addresses of this process or the disk is full."""
        if data.lifted or data.library.has_dynamic_globals:
            name = self._kernel.py_func.__qualname__
            warnings.warn(f"{name} cannot be kept: it reads large global arrays or pointers", NumbaWarning, 2)
            return
        save_kernel(self.file_name(sig, data.codegen), data._reduce())

    @property
    def cache_path(self) -> str | None:
        """The folder that is written to, for ``kernel.stats``."""
        folder = user_folder()
        return None if folder is None else str(folder)

    def enable(self) -> None:
        """Does nothing: a kernel is always kept."""

    def disable(self) -> None:
        """Does nothing: a kernel is always kept."""

    def flush(self) -> None:
        """Does nothing: files are never out of date."""


def _fields(signature: Iterable[Any]) -> Iterator[tuple[str, ...]]:
    """Yields the field names of all named tuples in argument types: kernels read fields by position."""
    for kind in signature:
        if isinstance(kind, types.NamedTuple | types.NamedUniTuple):
            yield kind.fields
        if isinstance(kind, types.BaseTuple):
            yield from _fields(kind)
        if isinstance(kind, types.StructRef):
            yield from _fields(kind.field_dict.values())


def _hash(parts: tuple[str, ...]) -> str:
    """Returns a hash of several texts with 20 hexadecimal digits: 80 bits make collisions unlikely."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:20]
