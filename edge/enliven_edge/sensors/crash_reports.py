"""Crash reports of camera firmware and camera libraries, in the user's state folder.

The doctor lists them. Nothing is sent automatically.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import platform
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from enliven.files import user_data_folder

log = logging.getLogger(__name__)

MAX_REPORTS = 20
"""Maximum number of stored reports. The newest are kept."""
MAX_TOTAL_BYTES = 64 << 20
"""Maximum bytes of all reports together. The oldest are removed first."""
_ADDRESS = re.compile(r"0x[0-9a-f]+|\d{4,}")
"""Pattern of text that differs between reports of the same crash: addresses and thread numbers."""
_SEEN = re.compile(r"^seen (\d+) times", re.MULTILINE)
_MAKERS = {
    "oak": ("depthai", "https://github.com/luxonis/depthai-core/issues"),
    "realsense": ("pyrealsense2", "https://github.com/IntelRealSense/librealsense/issues"),
    "orbbec": ("pyorbbecsdk2", "https://github.com/orbbec/pyorbbecsdk/issues"),
}
"""For each sensor, its library and the address of the library's developers for reports."""
_FIRMWARE = "https://discuss.luxonis.com"
"""The address of Luxonis for dumps of its cameras' firmware."""


@dataclass(frozen=True)
class CrashReport:
    """One report.

    Attributes:
        path: the file.
        when: time of the crash in seconds since 1970. If it occurred several times, the time of the last
            crash.
        what: the component that crashed.
        whereto: the address of its developers for reports.
    """

    path: Path
    when: float
    what: str
    whereto: str

    def __str__(self) -> str:
        day = time.strftime("%Y-%m-%d %H:%M", time.localtime(self.when))
        return (
            f"{self.path.name}, {day}: {self.what} crashed; send this report to {self.whereto}, and "
            "describe what you did"
        )


def reports_folder() -> Path:
    """Returns the folder of the reports."""
    return user_data_folder() / "crashes"


def list_stored_reports() -> list[CrashReport]:
    """Returns the stored reports, the newest first."""
    return [_report_from_file(path, when) for when, _, path in _report_files()]


def keep_text(sensor: str, text: str, signal: int) -> None:
    """Stores Python's traceback of a crash of a sensor's process.

    If the same crash occurs again, it is counted and not stored again.
    """
    stack_lines = [
        _ADDRESS.sub("", line) for line in text.splitlines() if line.startswith(("  File", "Fatal"))
    ]
    signature = hashlib.sha256("\n".join([str(signal), *stack_lines]).encode()).hexdigest()[:8]
    path = reports_folder() / f"{_convert_to_file_name(sensor)}-driver-{signature}.txt"
    library = _MAKERS.get(sensor, ("", ""))[0]
    with contextlib.suppress(PackageNotFoundError):
        library = f"{library} {version(library)}, " if library else ""
    versions = (
        f"enliven {version('enliven')}, {library}Python {platform.python_version()}, {platform.platform()}"
    )

    def write(temporary_path: Path) -> None:
        previous = _SEEN.search(path.read_text(errors="replace")) if path.is_file() else None
        count = 1 + (int(previous[1]) if previous else 0)
        temporary_path.write_text(
            f"sensor {sensor}, signal {signal}\n{versions}\nseen {count} times\n\n{text}"
        )

    _write_report(path, write)


def keep_dump(device: str, write: Callable[[Path], None]) -> None:
    """Stores the firmware dump of an OAK, a .tar.gz that ``write`` creates at the given path."""
    now = time.strftime("%Y%m%d-%H%M%S")
    _write_report(reports_folder() / f"oak-firmware-{_convert_to_file_name(device)}-{now}.tar.gz", write)


def remove_old_reports() -> None:
    """Removes the oldest reports that exceed the limits, including reports that a library wrote into the
    folder.
    """
    total = 0
    for number, (_, size, path) in enumerate(_report_files()):
        total += size
        if number >= MAX_REPORTS or total > MAX_TOTAL_BYTES:
            with contextlib.suppress(OSError):
                path.unlink()


def _write_report(path: Path, write: Callable[[Path], None]) -> None:
    """Writes a report completely or not at all. Disk errors are logged and otherwise ignored."""
    temporary_path = path.with_name(f".{os.getpid()}-{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(temporary_path)
        temporary_path.replace(path)
    except Exception as error:
        log.warning("a crash report cannot be saved: %s", error)
        with contextlib.suppress(OSError):
            temporary_path.unlink()
    else:
        log.warning("the crash report was saved: %s", path)
    remove_old_reports()


def _report_files() -> list[tuple[float, int, Path]]:
    """Returns (time in seconds since 1970, bytes, path) of each report, the newest first."""
    reports = []
    with contextlib.suppress(OSError):
        for path in reports_folder().rglob("*"):
            with contextlib.suppress(OSError):
                if path.is_file() and not path.is_symlink() and not path.name.startswith("."):
                    stat = path.stat()
                    reports.append((stat.st_mtime, stat.st_size, path))
    return sorted(reports, reverse=True)


def _report_from_file(path: Path, when: float) -> CrashReport:
    """Returns the report of a file, judged by its name. A library's own dumps have other names."""
    sensor = path.name.split("-")[0]
    if "-driver-" in path.name:
        return CrashReport(path, when, f"the library of {sensor}", _MAKERS.get(sensor, ("", "its makers"))[1])
    return CrashReport(path, when, "the firmware of the camera", _FIRMWARE)


def _convert_to_file_name(name: str) -> str:
    """Returns a name in a form that suits a file name."""
    return re.sub(r"[^\w.]+", "_", name)[:60]
