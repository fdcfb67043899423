"""Compiled kernels on disk: never stale, and never a reason not to start.

Numba keeps a kernel's machine code until the file of the kernel itself changes. But the code holds what the
kernel calls and the constants it names too, from other files, and one damaged file of the cache (a power
cut, a full disk) ends every later start. Here the code is kept until any of these changes, and a cache that
cannot be read or written costs a compilation.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import sys
from collections.abc import Iterator
from types import ModuleType
from typing import Any

from numba.core.caching import FunctionCache
from numba.core.dispatcher import Dispatcher

_CONSTANTS = (bool, int, float, complex, str, bytes, type(None))
"""Types of module constants that a kernel may hold a copy of."""


class KernelCache(FunctionCache):  # type: ignore[misc]
    """Keeps the machine code of one kernel on disk until what it is made of changes."""

    def __init__(self, kernel: Any) -> None:
        super().__init__(kernel)
        own = self._cache_file._source_stamp
        self.stamp = hashlib.sha256(repr((own, *_imported(kernel.__module__))).encode()).hexdigest()
        self._cache_file._source_stamp = self.stamp

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Returns the compiled kernel of a signature, or None where there is none that can be read."""
        with _unbroken():
            return super().load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keeps a compiled kernel, where the disk takes it."""
        try:
            super().save_overload(sig, data)
        except OSError:
            return
        except Exception:  # The index is damaged: it is written anew.
            with _unbroken():
                self.flush()
                super().save_overload(sig, data)


def keep(kernel: Any) -> Any:
    """Makes a kernel's machine code outlive the process, where there is a folder that can be written.

    Returns:
        The same kernel; a plain function, which ``NUMBA_DISABLE_JIT`` makes of it, stays as it is.
    """
    if not isinstance(kernel, Dispatcher):
        return kernel
    with contextlib.suppress(RuntimeError):  # No folder can be written: every start compiles.
        kernel._cache = KernelCache(kernel.py_func)
    return kernel


@contextlib.contextmanager
def _unbroken() -> Iterator[None]:
    """Lets a damaged or unwritable cache count as an empty one; unpickling it may raise anything."""
    with contextlib.suppress(Exception):
        yield


@functools.cache
def _imported(module: str) -> tuple[str, ...]:
    """Returns the stamps of all kernels and the values of all constants that a module imports.

    Imports stand above the first kernel, which is when this is asked for the first time. What the module
    states itself is in its own file, and Numba takes the stamp of that.
    """
    names = vars(sys.modules[module]) if module in sys.modules else {}
    return tuple(text for name in sorted(names) if (text := _text_of(name, names[name], module)))


def _text_of(name: str, value: Any, module: str) -> str:
    """Returns what the machine code may hold of a module's name, or an empty string."""
    if isinstance(value, Dispatcher):
        stamp = getattr(getattr(value, "_cache", None), "stamp", "")
        return f"{name} {stamp}" if value.py_func.__module__ != module else ""
    if isinstance(value, ModuleType) or name.startswith("__"):
        return ""
    if isinstance(value, _CONSTANTS) or (
        isinstance(value, tuple) and all(isinstance(v, _CONSTANTS) for v in value)
    ):
        return f"{name}={value!r}"
    return ""
