"""Compiles the kernels of a program for this exact processor, in a separate process with the lowest priority.

The process starts when the program has used no new kernel for a minute, and ends with the program. It does
not delay the program, because the operating system runs it only on idle cores.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import logging
import os
import pickle
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, Protocol

from enliven.kernel_cache.native_set import NativeSet, uses_native_code
from enliven.kernel_cache.program import PROGRAM_VARIABLE
from enliven.kernel_cache.target import has_chosen_target, host_processor

log = logging.getLogger(__name__)

MIN_IDLE_S = 60.0
"""Time in seconds without a new kernel after which the compilation starts. It is longer than the start of a
program."""
_COMPILER_MODULE = "enliven.kernel_cache.native_compiler"
"""Module that the process with the lowest priority runs."""
_POWER_SUPPLY_FOLDER = Path("/sys/class/power_supply")
"""Linux's folder of batteries and power supplies."""


class _Cache(Protocol):
    """The interface of a kernel's cache that the schedule needs."""

    @property
    def location(self) -> tuple[str, str]: ...

    def file_name(self, signature: Any, target: tuple[str, str, str]) -> str: ...


def record_use(cache: _Cache, signature: Any, platform: str) -> None:
    """Records that this session uses a kernel. The first record starts the schedule, if native code is
    enabled.

    Args:
        cache: the kernel's cache.
        signature: argument types of the kernel.
        platform: LLVM's name of the platform.
    """
    schedule = _get_schedule()
    if schedule is not None:
        schedule.record(cache, signature, platform)


@functools.cache
def _get_schedule() -> CompilationSchedule | None:
    """Returns this process's schedule, or None if this program does not compile native code."""
    if not has_chosen_target() or not uses_native_code():
        return None
    return CompilationSchedule(os.environ[PROGRAM_VARIABLE])


class CompilationSchedule:
    """The kernels of this session, and a thread that compiles native code for them after a minute without new
    kernels.

    Args:
        program: name of the program.
    """

    def __init__(self, program: str) -> None:
        self._program = program
        self._used: list[tuple[_Cache, Any, str]] = []
        self._last_use = time.monotonic()
        self._process: subprocess.Popen[bytes] | None = None
        self._ends = threading.Event()
        atexit.register(self.end)
        threading.Thread(target=self._run, name="native kernels", daemon=True).start()

    def record(self, cache: _Cache, signature: Any, platform: str) -> None:
        """Records a kernel of this session."""
        self._last_use = time.monotonic()
        self._used.append((cache, signature, platform))

    def end(self) -> None:
        """Stops the compilation. The finished kernels stay on disk."""
        self._ends.set()
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def _run(self) -> None:
        """Runs the compilation after each minute without new kernels, until the program ends."""
        count = 0
        while not self._ends.wait(MIN_IDLE_S):
            is_quiet = time.monotonic() - self._last_use >= MIN_IDLE_S
            if not is_quiet or count == len(self._used) or runs_on_battery():
                continue
            used_kernels = self._used[:]
            try:
                code = self._compile(used_kernels)
            except Exception as error:  # An error in this thread must not affect the program.
                log.warning("native code cannot be compiled in the background: %s", error)
                return
            if code == 0:
                count = len(used_kernels)

    def _compile(self, used: list[tuple[_Cache, Any, str]]) -> int:
        """Starts the process that compiles native code for kernels, and waits for its end. Returns its exit
        code."""
        from numba.core.serialize import dumps

        name, features = host_processor()
        kernels_by_name = {}
        for cache, signature, platform in used:
            module, kernel = cache.location
            # Kernels defined inside functions are left out, because they cannot be found by name.
            if "<locals>" not in kernel and module != "__main__":
                kernels_by_name[cache.file_name(signature, (platform, name, features))] = (
                    module,
                    kernel,
                    dumps(signature),
                )
        kernels = NativeSet.load(self._program)
        if kernels.is_complete and kernels_by_name.keys() <= set(kernels.kernels):
            return 0
        environment = {**os.environ, "NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": features}
        environment.pop(PROGRAM_VARIABLE, None)
        command = [sys.executable, "-m", _COMPILER_MODULE, self._program]
        priority = subprocess.IDLE_PRIORITY_CLASS if sys.platform == "win32" else 0
        quiet = subprocess.DEVNULL
        log.debug("compiling kernels of %s for %s in the background", self._program, name)
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=quiet,
            stderr=quiet,
            env=environment,
            creationflags=priority,
        )
        assert process.stdin is not None
        self._process = process
        pickle.dump(kernels_by_name, process.stdin)
        process.stdin.flush()  # Keep the input open. The process ends when it is closed.
        return process.wait()


def runs_on_battery() -> bool:
    """Returns True if a battery of this computer is discharging. Always returns False on systems other than
    Linux."""
    with contextlib.suppress(OSError):
        return any(
            (supply / "status").read_text().strip() == "Discharging"
            for supply in _POWER_SUPPLY_FOLDER.iterdir()
            if (supply / "status").exists()
        )
    return False
