"""Temporary folders that are removed even after a crash."""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

if sys.platform != "win32":
    import fcntl

_FOLDER_PREFIX = "enliven-capture-"
"""Prefix of the names of temporary folders. Older versions used the same prefix."""
_LOCK_NAME = ".in-use"
"""Name of the lock file in a temporary folder. The process that uses the folder keeps it locked."""
_MIN_ABANDONED_AGE_S = 86_400.0
"""Minimum age in seconds (a day) at which a temporary folder without a lock file counts as abandoned."""


class TemporaryFolder(tempfile.TemporaryDirectory[str]):
    """A folder in the system's temporary folder. It is removed at the end, or after a crash by a later start.

    While the process runs, it keeps a file in the folder locked. The operating system releases the lock when
    the process ends. On Windows the folder is not removed after a crash.

    Args:
        purpose: a word that becomes part of the folder's name.
    """

    def __init__(self, purpose: str) -> None:
        remove_dead_folders()
        super().__init__(prefix=f"{_FOLDER_PREFIX}{purpose}-", ignore_cleanup_errors=True)
        self._lock = -1
        if sys.platform != "win32":
            self._lock = os.open(Path(self.name) / _LOCK_NAME, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def cleanup(self) -> None:
        """Removes the folder. A second call does nothing."""
        super().cleanup()
        lock, self._lock = self._lock, -1
        if lock >= 0:
            os.close(lock)


def remove_dead_folders() -> list[str]:
    """Removes this user's temporary folders that killed processes have left behind. Returns their names.

    A folder without a lock file was left behind by an older version, or is being created. It is removed if it
    is older than a day. Symbolic links are not followed.
    """
    if sys.platform == "win32":
        return []
    removed = []
    with contextlib.suppress(OSError), _open_folder(tempfile.gettempdir()) as temporary:
        for name in os.listdir(temporary):
            if not name.startswith(_FOLDER_PREFIX):
                continue
            with contextlib.suppress(OSError), _open_folder(name, temporary) as folder:
                if os.fstat(folder).st_uid == os.geteuid() and _is_dead(folder):
                    shutil.rmtree(name, dir_fd=temporary)
                    removed.append(name)
    return removed


@contextlib.contextmanager
def _open_folder(name: str, within: int | None = None) -> Iterator[int]:
    """Opens a folder, and yields its descriptor for the parameter ``dir_fd``. Refuses links to folders."""
    links = 0 if within is None else os.O_NOFOLLOW
    descriptor = os.open(name, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC | links, dir_fd=within)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _is_dead(folder: int) -> bool:
    """Returns True if the process that created a :class:`TemporaryFolder` has ended. ``folder`` is its
    descriptor."""
    try:
        lock = os.open(_LOCK_NAME, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=folder)
    except FileNotFoundError:
        return time.time() - os.fstat(folder).st_mtime > _MIN_ABANDONED_AGE_S
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    finally:
        os.close(lock)
    return True
