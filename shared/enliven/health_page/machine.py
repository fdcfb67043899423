"""Reads the state of the computer and of processes: temperature, memory, disk and load.

Linux provides all values. Other systems provide only some of them, and the others are None.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import sys
import time
from collections.abc import Mapping
from pathlib import Path

from enliven.errors import InputError, ResourceError
from enliven.health_page.snapshot import MachineState

_THERMAL_FOLDER = Path("/sys/class/thermal")
"""Linux folder with the temperatures of the thermal zones."""
_PROC_FOLDER = Path("/proc")
"""Linux folder with information about processes and memory."""
_MIN_TEMPERATURE_C = -40.0
"""Minimum plausible temperature in degrees Celsius. Sensors that are not connected report lower values."""
_MAX_TEMPERATURE_C = 150.0
"""Maximum plausible temperature in degrees Celsius. Faulty sensors report higher values."""
_PROGRAM_PATTERN = b"enliven"
"""Word that the command line of every enliven program contains."""


def read_machine(folder: Path, thermal: Path = _THERMAL_FOLDER, proc: Path = _PROC_FOLDER) -> MachineState:
    """Returns the state of the computer.

    Args:
        folder: a folder on the disk to measure. If it does not exist, its nearest existing parent is used.
        thermal: folder with the thermal zones.
        proc: folder with the files of the kernel.
    """
    memory = _read_memory(proc / "meminfo")
    folder = _find_existing_parent(folder)
    disk_bytes = disk_free_bytes = load = None
    with contextlib.suppress(OSError):
        usage = shutil.disk_usage(folder)
        disk_bytes, disk_free_bytes = float(usage.total), float(usage.free)
    if hasattr(os, "getloadavg"):
        with contextlib.suppress(OSError):
            load = os.getloadavg()[0]
    return MachineState(
        temperature_c=_read_temperature(thermal),
        memory_bytes=memory.get("MemTotal"),
        memory_available_bytes=memory.get("MemAvailable"),
        disk_folder=str(folder),
        disk_bytes=disk_bytes,
        disk_free_bytes=disk_free_bytes,
        load=load,
        processors=os.cpu_count() or 1,
        uptime_s=_read_uptime(proc / "uptime"),
    )


def is_running(pid: int) -> bool:
    """Returns True if a process is running. A zombie process does not count."""
    if pid <= 0:
        return False
    with contextlib.suppress(OSError):
        # The state follows the process name in parentheses. The name may contain any character.
        return (_PROC_FOLDER / str(pid) / "stat").read_bytes().rpartition(b")")[2].split()[0] not in (
            b"Z",
            b"X",
        )
    if sys.platform in ("linux", "win32"):
        return False
    try:
        os.kill(pid, 0)
    except PermissionError:
        return True
    except OSError:
        return False
    return True


def resident_bytes(pid: int) -> float | None:
    """Returns the resident memory of a process in bytes, or None if it is unknown."""
    try:
        pages = int((_PROC_FOLDER / str(pid) / "statm").read_bytes().split()[1])
    except (OSError, ValueError, IndexError):
        return None
    return float(pages * os.sysconf("SC_PAGE_SIZE"))


def terminate_program(name: str, pid: int) -> None:
    """Terminates a program of enliven by SIGTERM. Its supervisor starts it again.

    Raises:
        InputError: if the process has ended, or another program has the same process id now.
        ResourceError: if this user may not terminate it.
    """
    ended_error = InputError(
        f"the program {name} is not running", remedy="Wait until the supervisor restarts the program."
    )
    if pid <= 1 or not is_running(pid):
        raise ended_error
    # The descriptor refers to this process only, so a later process with the same id cannot be terminated by
    # mistake.
    descriptor = -1
    try:
        if hasattr(os, "pidfd_open"):
            descriptor = os.pidfd_open(pid)
        if (
            _PROC_FOLDER.is_dir()
            and _PROGRAM_PATTERN not in (_PROC_FOLDER / str(pid) / "cmdline").read_bytes()
        ):
            raise InputError(
                f"process {pid} is not a program of enliven",
                remedy=f"Restart {name} by its supervisor (systemd or enliven kiosk).",
            )
        if descriptor >= 0:
            signal.pidfd_send_signal(descriptor, signal.SIGTERM)
        else:
            os.kill(pid, signal.SIGTERM)
    except PermissionError:
        raise ResourceError(
            f"the program {name} belongs to another user",
            remedy="Run the health page as the same user as the program.",
        ) from None
    except (ProcessLookupError, FileNotFoundError):
        raise ended_error from None
    finally:
        if descriptor >= 0:
            os.close(descriptor)


def _find_existing_parent(folder: Path) -> Path:
    """Returns a folder, or its nearest parent that exists."""
    folder = folder.absolute()
    for candidate in (folder, *folder.parents):
        if candidate.is_dir():
            return candidate
    return folder


def _read_memory(path: Path) -> Mapping[str, float]:
    """Returns the values of /proc/meminfo in bytes by name."""
    values = {}
    with contextlib.suppress(OSError):
        for line in path.read_text().splitlines():
            name, _, rest = line.partition(":")
            words = rest.split()
            if words and words[0].isdecimal():
                values[name] = 1024.0 * int(words[0])
    return values


def _read_temperature(thermal: Path) -> float | None:
    """Returns the highest plausible temperature in degrees Celsius."""
    temperatures = []
    for path in thermal.glob("thermal_zone*/temp"):
        with contextlib.suppress(OSError, ValueError):
            temperatures.append(int(path.read_text()) / 1000.0)
    plausible = [value for value in temperatures if _MIN_TEMPERATURE_C < value < _MAX_TEMPERATURE_C]
    return max(plausible, default=None)


def _read_uptime(path: Path) -> float | None:
    """Returns the time since the start of the computer in seconds."""
    try:
        return float(path.read_text().split()[0])
    except (OSError, ValueError, IndexError):
        return time.clock_gettime(time.CLOCK_BOOTTIME) if hasattr(time, "CLOCK_BOOTTIME") else None
