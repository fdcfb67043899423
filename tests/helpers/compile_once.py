"""Makes concurrent test processes compile each kernel only once, and share the result.

Numba caches compiled kernels on disk. But two processes that need the same kernel at the same time both
compile it, and may overwrite each other's entry in the kernel's index. Here a process locks a kernel for all
processes before compiling it; the next process finds the result on disk.
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
except ImportError:  # Windows has no fcntl: every process compiles all kernels.
    fcntl = None

_LOCKS = 1 << 31
"""Size in bytes of the range of the lock file in which each kernel locks one byte. The file itself stays
empty.
"""


@contextlib.contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Disables garbage collection within a block. Collection takes a tenth of compile time; without it, up to
    80 MB are not freed.
    """
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def compile_once(lock_file: Path) -> None:
    """Locks a kernel while this process compiles or loads it. ``lock_file`` is the same for all processes.

    Numba's own lock is acquired first, and then the locks in the order of calls between kernels, which
    prevents deadlocks.
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
