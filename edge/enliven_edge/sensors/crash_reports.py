"""Reports of crashes, of a camera's own program and of its library, in the user's state folder.

The doctor lists them. Nothing is sent anywhere by itself.
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

from enliven.files import own_folder

log = logging.getLogger(__name__)

MOST_KEPT = 20
"""Reports that are kept, the newest."""
MOST_BYTES = 64 << 20
"""Bytes of all reports together; the oldest go first."""
_ADDRESS = re.compile(r"0x[0-9a-f]+|\d{4,}")
"""What is different in every report of the same crash: addresses and numbers of threads."""
_SEEN = re.compile(r"^seen (\d+) times", re.MULTILINE)
_MAKERS = {
    "oak": ("depthai", "https://github.com/luxonis/depthai-core/issues"),
    "realsense": ("pyrealsense2", "https://github.com/IntelRealSense/librealsense/issues"),
    "orbbec": ("pyorbbecsdk2", "https://github.com/orbbec/pyorbbecsdk/issues"),
}
"""The library of a sensor, and where its makers take reports."""
_FIRMWARE = "https://discuss.luxonis.com"
"""Where Luxonis asks for the dumps of its cameras' own programs."""


@dataclass(frozen=True)
class CrashReport:
    """One report.

    Attributes:
        path: the file.
        when: seconds since 1970 of the crash, the last one where it was seen several times.
        what: what crashed.
        whereto: where its makers take reports.
    """

    path: Path
    when: float
    what: str
    whereto: str

    def __str__(self) -> str:
        day = time.strftime("%Y-%m-%d %H:%M", time.localtime(self.when))
        return f"{self.path.name}, {day}: {self.what} crashed; send it, with what you did, to {self.whereto}"


def folder() -> Path:
    """Where reports are kept."""
    return own_folder() / "crashes"


def reports() -> list[CrashReport]:
    """The reports that are kept, the newest first."""
    return [_report(path, when) for when, _, path in _files()]


def keep_text(sensor: str, text: str, signal: int) -> None:
    """Keeps what Python said of a crash of a sensor's process; the same crash is kept once, and counted."""
    steps = [_ADDRESS.sub("", line) for line in text.splitlines() if line.startswith(("  File", "Fatal"))]
    mark = hashlib.sha256("\n".join([str(signal), *steps]).encode()).hexdigest()[:8]
    path = folder() / f"{_plain(sensor)}-driver-{mark}.txt"
    library = _MAKERS.get(sensor, ("", ""))[0]
    with contextlib.suppress(PackageNotFoundError):
        library = f"{library} {version(library)}, " if library else ""
    told = f"enliven {version('enliven')}, {library}Python {platform.python_version()}, {platform.platform()}"

    def write(passing: Path) -> None:
        before = _SEEN.search(path.read_text(errors="replace")) if path.is_file() else None
        count = 1 + (int(before[1]) if before else 0)
        passing.write_text(f"sensor {sensor}, signal {signal}\n{told}\nseen {count} times\n\n{text}")

    _keep(path, write)


def keep_dump(device: str, write: Callable[[Path], None]) -> None:
    """Keeps the dump of an OAK's own program, a .tar.gz that ``write`` makes at the path that it is given."""
    now = time.strftime("%Y%m%d-%H%M%S")
    _keep(folder() / f"oak-firmware-{_plain(device)}-{now}.tar.gz", write)


def tidy() -> None:
    """Removes the oldest reports beyond the limits, those that a library wrote into the folder too."""
    total = 0
    for number, (_, size, path) in enumerate(_files()):
        total += size
        if number >= MOST_KEPT or total > MOST_BYTES:
            with contextlib.suppress(OSError):
                path.unlink()


def _keep(path: Path, write: Callable[[Path], None]) -> None:
    """Writes a report whole or not at all; what the disk refuses is logged, and stops nothing."""
    passing = path.with_name(f".{os.getpid()}-{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(passing)
        passing.replace(path)
    except Exception as error:
        log.warning("a report of a crash cannot be kept: %s", error)
        with contextlib.suppress(OSError):
            passing.unlink()
    else:
        log.warning("a report of the crash is kept: %s", path)
    tidy()


def _files() -> list[tuple[float, int, Path]]:
    """(time, bytes, path) of each report, the newest first."""
    found = []
    with contextlib.suppress(OSError):
        for path in folder().rglob("*"):
            with contextlib.suppress(OSError):
                if path.is_file() and not path.is_symlink() and not path.name.startswith("."):
                    stat = path.stat()
                    found.append((stat.st_mtime, stat.st_size, path))
    return sorted(found, reverse=True)


def _report(path: Path, when: float) -> CrashReport:
    """What a file is, by its name: a library's own dumps have names of theirs."""
    sensor = path.name.split("-")[0]
    if "-driver-" in path.name:
        return CrashReport(path, when, f"the library of {sensor}", _MAKERS.get(sensor, ("", "its makers"))[1])
    return CrashReport(path, when, "the camera's own program", _FIRMWARE)


def _plain(name: str) -> str:
    """A name as a part of a file's name."""
    return re.sub(r"[^\w.]+", "_", name)[:60]
