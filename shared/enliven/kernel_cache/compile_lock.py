"""Makes concurrent processes compile each kernel once: one compiles it, and the others wait for the result.

Edge, viewer and their helper processes start at the same time and need many of the same kernels. A process
locks a kernel before it compiles it. The lock is a byte of the file ``compile.lock`` in the folder of
compiled kernels. The operating system releases it when the process ends.
"""

from __future__ import annotations

import contextlib
import functools
import os
import sys
import time
import zlib
from pathlib import Path

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

_MAX_WAIT_S = 60.0
"""Maximum time in seconds to wait for another process. The slowest kernel takes a quarter of it on a desktop
computer. A process that was suspended would hold its lock for ever."""
_POLL_INTERVAL_S = 0.01
"""Seconds between two attempts to lock. Loading a kernel takes about as long."""
_RANGE = 1 << 31
"""Number of bytes that can be locked, one per kernel. The file itself stays empty."""


class CompileLock:
    """The lock of the kernel that this process is compiling. At most one kernel is locked at a time.

    Numba's compiler lock must be held during all calls.
    """

    def __init__(self) -> None:
        self._handle = -1
        self._place = -1

    @property
    def is_locked(self) -> bool:
        """Returns True if this process has locked a kernel."""
        return self._place >= 0

    def acquire(self, folder: Path, name: str) -> None:
        """Locks a kernel. Waits while another process has locked it, at most for a minute.

        Without a lock, for example in a folder that cannot be written, several processes may compile the
        kernel.

        Args:
            folder: the folder of compiled kernels.
            name: file name of the kernel.
        """
        self.release()
        with contextlib.suppress(OSError):
            handle, place = _open_lock_file(folder), zlib.crc32(name.encode()) % _RANGE
            deadline = time.monotonic() + _MAX_WAIT_S
            while not _try_lock(handle, place):
                if time.monotonic() > deadline:
                    return
                time.sleep(_POLL_INTERVAL_S)
            self._handle, self._place = handle, place

    def release(self) -> None:
        """Unlocks the kernel. Does nothing without a lock."""
        if self.is_locked:
            _unlock(self._handle, self._place)
            self._place = -1


@functools.cache
def _open_lock_file(folder: Path) -> int:
    """Returns a handle of the lock file. It stays open, because closing it would release all locks.

    Raises:
        OSError: if the file cannot be created.
    """
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    return os.open(folder / "compile.lock", os.O_RDWR | os.O_CREAT, 0o600)


def _try_lock(handle: int, place: int) -> bool:
    """Locks a byte of the file. Returns False if another process has locked it.

    Raises:
        OSError: if the file system supports no locks.
    """
    try:
        if sys.platform == "win32":
            os.lseek(handle, place, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
    except (BlockingIOError, PermissionError):  # POSIX allows EAGAIN and EACCES. Windows reports EACCES.
        return False
    return True


def _unlock(handle: int, place: int) -> None:
    with contextlib.suppress(OSError):
        if sys.platform == "win32":
            os.lseek(handle, place, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_UNLCK, 1)
        else:
            fcntl.lockf(handle, fcntl.LOCK_UN, 1, place)


compile_lock = CompileLock()
"""The lock of this process."""
