"""The program of the process that compiles kernels for this exact processor.
:mod:`~enliven.kernel_cache.native_schedule` starts it.

It reads the list of kernels from its standard input, which the parent program keeps open. The input is closed
when the parent ends, and then this process ends, too.
"""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import functools
import importlib
import os
import pickle
import platform
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

from enliven.kernel_cache.native_schedule import runs_on_battery
from enliven.kernel_cache.native_set import NativeSet
from enliven.kernel_cache.store import user_folder

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

MissingKernel = dict[str, tuple[str, str, bytes]]
"""The kernels to compile. Maps the file name of the native kernel to its module, its name in the module, and
its pickled argument types.
"""
RETRY_LATER_EXIT_CODE = 3
"""Exit code if another process is already compiling, or the computer runs on battery."""
_NICENESS = 19
"""The lowest priority of POSIX."""
_IOPRIO_SET = {"x86_64": 251, "aarch64": 30}
"""Number of Linux's system call ``ioprio_set``, by machine. The C library has no function for it."""
_IDLE_IO_CLASS = 3 << 13
"""Linux's I/O priority class "idle", in which disk access waits for all other processes."""


def main(program: str) -> int:
    """Compiles the kernels on the standard input for this processor. Returns the exit code."""
    lower_priority()
    missing_kernel: MissingKernel = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_with_input, daemon=True).start()
    folder = user_folder()
    if folder is None:
        return 0
    with lock_compilation(folder) as has_lock:
        return compile_missing(program, missing_kernel, folder) if has_lock else RETRY_LATER_EXIT_CODE


def lower_priority() -> None:
    """Gives this process the lowest priority for processor and disk that the operating system has."""
    if sys.platform == "win32":
        return  # On this system the program has already started this process with idle priority.
    os.setpriority(os.PRIO_PROCESS, 0, _NICENESS)
    if sys.platform == "linux":
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
        if platform.machine() in _IOPRIO_SET:
            ctypes.CDLL(None).syscall(_IOPRIO_SET[platform.machine()], 1, 0, _IDLE_IO_CLASS)


def compile_missing(program: str, wanted: MissingKernel, folder: Path) -> int:
    """Compiles the kernels in sequence, and stores the state after each kernel. Returns the exit code."""
    stored_set = NativeSet.load(program)
    compiled_names = [name for name in stored_set.kernels if (folder / name).exists()]
    missing_names = [
        name for name in wanted if name not in stored_set.failed and not (folder / name).exists()
    ]
    state = NativeSet(
        program, tuple(sorted({*compiled_names, *wanted})), tuple(missing_names), stored_set.failed
    )
    state.save()
    for name in missing_names:
        if runs_on_battery():
            return RETRY_LATER_EXIT_CODE
        failed = state.failed if compile_kernel(name, *wanted[name]) else (*state.failed, name)
        if name not in failed and not (folder / name).exists():
            return 0  # The disk is full, or the folder cannot be written.
        state = dataclasses.replace(state, missing=state.missing[1:], failed=failed)
        state.save()
    return 0


def compile_kernel(name: str, module: str, kernel: str, signature: bytes) -> bool:
    """Compiles one kernel and stores it under its name. Returns False if it cannot be compiled here."""
    try:
        dispatcher = functools.reduce(getattr, kernel.split("."), importlib.import_module(module))
        types = pickle.loads(signature)
        target = dispatcher.targetctx.codegen().magic_tuple()
        if dispatcher._cache.file_name(types, target) != name:
            return False
        dispatcher.compile(types)
    except Exception:  # Sessions use the portable code of this kernel instead.
        return False
    return True


def _end_with_input() -> None:
    """Ends this process when its standard input is closed."""
    with contextlib.suppress(OSError):
        while os.read(sys.stdin.fileno(), 1):  # Python's own reader would block the end of the interpreter.
            pass
    os._exit(0)


@contextlib.contextmanager
def lock_compilation(folder: Path) -> Iterator[bool]:
    """Yields True if no other process compiles native code into this folder. The system releases the lock
    when this process ends.
    """
    handle = os.open(folder / "native.lock", os.O_RDWR | os.O_CREAT, 0o600)
    try:
        if sys.platform == "win32":
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        yield False
    else:
        yield True
    finally:
        os.close(handle)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
