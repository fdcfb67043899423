"""The on-disk cache of machine code: Numba loads kernels from it."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import warnings
from collections.abc import Iterable, Iterator
from typing import Any

from numba.core import types
from numba.core.caching import _Cache
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaWarning

from enliven.kernel_cache.callees import compiles_callee, is_callee
from enliven.kernel_cache.compile_lock import compile_lock
from enliven.kernel_cache.fingerprint import describe_options, fingerprint
from enliven.kernel_cache.loading import rebuild_kernel, unpickle_kernel
from enliven.kernel_cache.native_schedule import record_use
from enliven.kernel_cache.store import load_kernel, save_kernel, user_folder
from enliven.kernel_cache.target import is_native_session, processor_levels
from enliven.kernel_cache.versions import CODE_VERSIONS


def cache_kernel_on_disk(kernel: Any) -> Any:
    """Enables the disk cache for a kernel, so that later processes load its machine code from disk.

    Returns:
        The same kernel. If ``NUMBA_DISABLE_JIT`` is set, it is a plain function and returned unchanged.
    """
    if isinstance(kernel, Dispatcher):
        kernel._cache = KernelCache(kernel)
    return kernel


class KernelCache(_Cache):
    """The cache of one kernel. It loads and saves machine code, with one file per combination of argument
    types."""

    def __init__(self, kernel: Any) -> None:
        self._kernel = kernel

    @property
    def location(self) -> tuple[str, str]:
        """The kernel's module, and its qualified name in this module."""
        return self._kernel.py_func.__module__, self._kernel.py_func.__qualname__

    @functools.cached_property
    def _file_stem(self) -> str:
        """The kernel's name, and a hash of everything that its code depends on except the argument types.

        It is computed at the first call, because globals that the file defines after the kernel do not exist
        earlier.
        """
        function = self._kernel.py_func
        parts = fingerprint(function), describe_options(self._kernel), repr(CODE_VERSIONS)
        return f"{function.__name__}-{_hash(parts)}"

    def file_name(self, signature: Any, target: tuple[str, str, str]) -> str:
        """Returns the file name of the machine code for argument types.

        Args:
            signature: the argument types.
            target: LLVM's names of the platform, the processor and its features.
        """
        parts = repr(signature), repr(list(_iterate_field_names(signature))), repr(target)
        return f"{self._file_stem}-{_hash(parts)}.kernel"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Returns the compiled kernel for argument types, or None if no folder contains it.

        If native code is enabled but missing for this kernel, the code for the processor's level is used. If
        another process is compiling the kernel, waits for it. If the result is None, the kernel is locked
        until :class:`~enliven.kernel_cache.callees.KernelDispatcher` has compiled it.
        """
        compiled, folder = self._load(sig, target_context), user_folder()
        if compiled is None and folder is not None and not compiles_callee():
            compile_lock.acquire(folder, self.file_name(sig, target_context.codegen().magic_tuple()))
            compiled = self._load(sig, target_context)
        return compiled

    def _load(self, sig: Any, target_context: Any) -> Any:
        """Returns the compiled kernel for argument types, or None if no folder contains it."""
        target = target_context.codegen().magic_tuple()
        targets = [target, (target[0], processor_levels()[0], "")] if is_native_session() else [target]
        for possible_target in targets:
            with contextlib.suppress(Exception):  # If machine code cannot be loaded, it is compiled again.
                data = load_kernel(self.file_name(sig, possible_target), unpickle_kernel)
                if data is not None:
                    record_use(self, sig, target[0])
                    return rebuild_kernel(target_context, data)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Saves a compiled kernel, unless the code contains addresses of this process or the disk is full.

        A callee is not saved: kernels include it.
        """
        if is_callee(data):
            return
        if data.lifted or data.library.has_dynamic_globals:
            name = self._kernel.py_func.__qualname__
            warnings.warn(
                f"the kernel {name} is not cached, because it uses large global arrays or pointers",
                NumbaWarning,
                2,
            )
            return
        target = data.codegen.magic_tuple()
        save_kernel(self.file_name(sig, target), data._reduce())
        record_use(self, sig, target[0])

    @property
    def cache_path(self) -> str | None:
        """The folder for new files, for ``kernel.stats``."""
        folder = user_folder()
        return None if folder is None else str(folder)

    def enable(self) -> None:
        """Does nothing: kernels are always stored."""

    def disable(self) -> None:
        """Does nothing: kernels are always stored."""

    def flush(self) -> None:
        """Does nothing: files are never outdated."""


def _iterate_field_names(signature: Iterable[Any]) -> Iterator[tuple[str, ...]]:
    """Yields the field names of all named tuples in argument types. They must be part of the hash, because
    kernels read fields by position."""
    for kind in signature:
        if isinstance(kind, types.NamedTuple | types.NamedUniTuple):
            yield kind.fields
        if isinstance(kind, types.BaseTuple):
            yield from _iterate_field_names(kind)
        if isinstance(kind, types.StructRef):
            yield from _iterate_field_names(kind.field_dict.values())


def _hash(parts: tuple[str, ...]) -> str:
    """Returns a hash of several texts with 20 hexadecimal digits. With 80 bits, collisions are unlikely."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:20]
