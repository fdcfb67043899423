"""Makes test processes that run at the same time compile each kernel once, and keep what they compiled.

Numba keeps compiled kernels on disk, but two processes that need the same kernel at the same time both
compile it, and may overwrite each other's entry in the kernel's index. Here a process that is about to
compile locks the kernel for all processes; the next one finds the result on disk.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import os
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numba.core.dispatcher
from numba.core.compiler_lock import global_compiler_lock

try:
    import fcntl
except ImportError:  # Windows: every process compiles for itself, as without this file.
    fcntl = None  # type: ignore[assignment]

_LOCKS = 1 << 31
"""Bytes of the lock file that stand for kernels; the file itself stays empty."""


@contextlib.contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Puts off collections of garbage, a tenth of the time that compiling takes, for at most 80 MB more."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def compile_once(lock_file: Path) -> None:
    """Locks a kernel while this process compiles it or loads it; ``lock_file`` is the same for all processes.

    Locks are taken in the order of calls between kernels, with Numba's own lock held first, so that two
    processes never wait for each other.
    """
    if fcntl is None:
        return
    handle = os.open(lock_file, os.O_RDWR | os.O_CREAT, 0o600)
    plain = numba.core.dispatcher.Dispatcher.compile

    @functools.wraps(plain)
    def locked(self: Any, signature: Any) -> Any:
        kernel = f"{self.py_func.__module__}.{self.py_func.__qualname__}"
        place = zlib.crc32(kernel.encode()) % _LOCKS
        with global_compiler_lock, no_garbage_collection():
            fcntl.lockf(handle, fcntl.LOCK_EX, 1, place)
            try:
                return plain(self, signature)
            finally:
                fcntl.lockf(handle, fcntl.LOCK_UN, 1, place)

    numba.core.dispatcher.Dispatcher.compile = locked
