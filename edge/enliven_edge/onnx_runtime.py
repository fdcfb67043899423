"""Loads ONNX Runtime without its telemetry, and removes the telemetry files of earlier runs.

The library's official packages (since version 1.29) send data about the machine and its programs to
Microsoft. They store a persistent device id and a queue of events in the user's cache folder, and a session
file in the temporary folder. The telemetry is off only if an environment variable is set before the library
is loaded. So every import of onnxruntime in this project goes through :func:`load_onnxruntime`. A test in
``tests/conventions`` checks this.
"""

from __future__ import annotations

import contextlib
import importlib
import logging
import os
import re
import stat
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

if sys.platform != "win32":
    import fcntl

log = logging.getLogger(__name__)

TELEMETRY_SWITCH = "ORT_DISABLE_TELEMETRY"
"""Environment variable that ONNX Runtime reads once, when it is loaded. 1 disables its telemetry."""
_FOLDER = ("Microsoft", "DeveloperTools", ".onnxruntime")
"""ONNX Runtime's folder for telemetry, below the user's cache folder."""
_DEVICE_ID = re.compile(rb"[0-9a-fA-F]{8}(-[0-9a-fA-F]{4}){3}-[0-9a-fA-F]{12}\s*")
"""Pattern of the content of the file ``deviceid``."""
_SESSION = re.compile(rb"\d{13}\n[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}\s*")
"""Pattern of the content of the file ``.ses``: milliseconds of the epoch, then an id."""
_FILES = re.compile(r"deviceid(\.lock|\.tmp\..*)?|onnxruntime\.db(-shm|-wal|-journal)?")
"""Pattern of the names of the telemetry's files in its folder."""
_MAX_SIGNATURE_BYTES = 64
"""Number of bytes that are read from a file to recognise it. The content of both patterns is shorter."""
_SQLITE_MAGIC = b"SQLite format 3\0"
"""The first bytes of the event queue, an SQLite database."""
_IN_USE_BYTE = 128
"""The byte of a ``-shm`` file that SQLite keeps locked while a process has the database open."""


def disable_telemetry() -> None:
    """Sets the environment variable that disables ONNX Runtime's telemetry, here and in child processes.

    A value set by the user is replaced, because a program with a camera must never send data to third
    parties. A warning is logged if the process has already loaded the library with its telemetry.
    """
    if "onnxruntime" in sys.modules and os.environ.get(TELEMETRY_SWITCH) != "1":
        log.warning(
            "onnxruntime was imported before enliven, with its telemetry on. Set %s=1 before the import.",
            TELEMETRY_SWITCH,
        )
    os.environ[TELEMETRY_SWITCH] = "1"


def load_onnxruntime(module: str = "onnxruntime") -> Any:
    """Returns ONNX Runtime, or one of its modules, loaded without telemetry.

    The first call of a process removes the telemetry files that earlier runs left.
    """
    disable_telemetry()
    if "onnxruntime" not in sys.modules:
        remove_telemetry_files()
    library = importlib.import_module("onnxruntime")
    # On Windows, the builds that use the system's own telemetry do not read the environment variable.
    library.disable_telemetry_events()
    return importlib.import_module(module)


def remove_telemetry_files() -> list[Path]:
    """Removes the device id, the queued events and the session file of ONNX Runtime. Returns their paths.

    A file is removed only if its folder, name, owner and content match the telemetry. Symbolic links are not
    followed. Nothing is removed while another process has the queue open.
    """
    if sys.platform == "win32":
        return []
    removed: list[Path] = []
    for folder in _telemetry_folders():
        with contextlib.suppress(OSError), _open_folder(folder) as descriptor:
            removed += [folder / name for name in _remove_own_files(descriptor)]
        if not any(path.parent == folder for path in removed):
            continue
        with contextlib.suppress(OSError):  # A folder that still contains other files is kept.
            for emptied in (folder, *folder.parents[: len(_FOLDER) - 1]):
                emptied.rmdir()
    session = Path(tempfile.gettempdir()) / ".ses"
    # Other libraries of the same vendor write this session file, too. So it is removed only together with the
    # telemetry folder.
    if removed and _SESSION.fullmatch(_read_first_bytes(session)):
        with contextlib.suppress(OSError):
            session.unlink()
            removed.append(session)
    if removed:
        log.info("removed the telemetry files that ONNX Runtime had left in %s", removed[0].parent)
    return removed


def _telemetry_folders() -> Iterator[Path]:
    """Yields the folders in which ONNX Runtime keeps telemetry on Linux and on macOS."""
    with contextlib.suppress(RuntimeError):
        home = Path(os.environ.get("HOME") or Path.home())
        if sys.platform == "darwin":
            yield home.joinpath("Library", "Application Support", *_FOLDER)
        yield home.joinpath(".cache", *_FOLDER)
    if os.environ.get("XDG_CACHE_HOME"):
        yield Path(os.environ["XDG_CACHE_HOME"]).joinpath(*_FOLDER)


@contextlib.contextmanager
def _open_folder(folder: Path) -> Iterator[int]:
    """Opens ``folder`` for functions with ``dir_fd``. The last components of its path must not be symbolic
    links.

    Raises:
        OSError: if it is missing, or a part of it is a link.
    """
    flags = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC
    descriptor = os.open(folder.parents[len(_FOLDER) - 1], flags)
    try:
        for name in _FOLDER:
            inner = os.open(name, flags | os.O_NOFOLLOW, dir_fd=descriptor)
            os.close(descriptor)
            descriptor = inner
        yield descriptor
    finally:
        os.close(descriptor)


def _remove_own_files(folder: int) -> list[str]:
    """Removes the telemetry's files from an opened folder and returns their names. Removes nothing if one is
    in use.
    """
    names = [name for name in os.listdir(folder) if _FILES.fullmatch(name)]
    if "onnxruntime.db-shm" in names and _is_in_use("onnxruntime.db-shm", folder):
        return []
    is_queue = _read_first_bytes("onnxruntime.db", folder).startswith(_SQLITE_MAGIC)
    is_device_id = _DEVICE_ID.fullmatch(_read_first_bytes("deviceid", folder)) is not None
    removed = []
    for name in names:
        is_telemetry = is_device_id if name.startswith("deviceid") else is_queue
        if is_telemetry and _is_own_file(os.stat(name, dir_fd=folder, follow_symlinks=False)):
            os.unlink(name, dir_fd=folder)
            removed.append(name)
    return removed


def _is_own_file(status: os.stat_result) -> bool:
    """Returns True for a regular file of this user without further hard links."""
    return stat.S_ISREG(status.st_mode) and status.st_uid == os.geteuid() and status.st_nlink == 1


def _read_first_bytes(path: Path | str, folder: int | None = None) -> bytes:
    """Returns the first bytes of this user's regular file, or no bytes if it does not exist."""
    flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    try:
        descriptor = os.open(path, flags, dir_fd=folder)
    except OSError:
        return b""
    with os.fdopen(descriptor, "rb") as file:
        return file.read(_MAX_SIGNATURE_BYTES) if _is_own_file(os.fstat(descriptor)) else b""


def _is_in_use(name: str, folder: int) -> bool:
    """Returns True if a process has the database of this ``-shm`` file open.

    This is judged by SQLite's lock on the file.
    """
    try:
        descriptor = os.open(name, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, dir_fd=folder)
    except OSError:
        return True
    try:
        fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _IN_USE_BYTE)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False
