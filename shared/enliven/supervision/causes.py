"""Determines why a program ended: by an exit code, by a signal, or because the kernel killed it for lack of
memory."""

from __future__ import annotations

import contextlib
import signal
from pathlib import Path

INTERRUPTED_EXIT_CODE = 130
"""Exit code of a program that was ended by Ctrl-C or SIGTERM: 128 + SIGINT (2), by the convention of
shells."""
OUT_OF_MEMORY_CAUSE = "killed by the operating system, because the memory was full"
"""Cause of a program that Linux killed to free memory."""
_CGROUP_ROOT = Path("/sys/fs/cgroup")
"""Mount point of Linux's control groups (version 2), which limit the memory of services."""


def describe_exit(code: int) -> str:
    """Returns the reason for the end of a program: its exit code, or the signal if the code is negative."""
    if code >= 0:
        return f"exit code {code}"
    with contextlib.suppress(ValueError):
        return f"signal {signal.Signals(-code).name}"
    return f"signal {-code}"


def exit_code_from_status(code: int) -> int:
    """Returns a child's exit status as an exit code: 130 if it was interrupted, 1 if it crashed."""
    if code in (-signal.SIGINT, -signal.SIGTERM):
        return INTERRUPTED_EXIT_CODE
    return 1 if code < 0 else code


def count_memory_kills(proc: Path = Path("/proc"), cgroups: Path = _CGROUP_ROOT) -> int:
    """Returns the number of processes that the kernel has killed for lack of memory, on this computer plus in
    this service.

    Only the difference between two calls is meaningful. Returns 0 on systems other than Linux.
    """
    count = _read_counter(proc / "vmstat")
    with contextlib.suppress(OSError):
        for line in (proc / "self" / "cgroup").read_text().splitlines():
            if line.startswith("0::"):
                count += _read_counter(cgroups / line.removeprefix("0::").strip("/") / "memory.events")
    return count


def _read_counter(path: Path) -> int:
    """Returns the value of the counter ``oom_kill`` in a file, or 0 if the file or the counter is missing."""
    with contextlib.suppress(OSError, ValueError):
        for line in path.read_text().splitlines():
            key, _, value = line.partition(" ")
            if key == "oom_kill":
                return int(value)
    return 0
