"""Keeps an edge's name unique on a machine, by a locked file in a folder that only its user may write to.

The operating system releases the lock when the process ends for any reason, so no name stays locked. The
folder must be private. In a shared folder, another user could replace the file by a link, and the link's
target would be emptied.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import stat
import sys
import tempfile
import time
from pathlib import Path

from enliven.errors import ResourceError

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

_LOCKED_BYTE = 1 << 30
"""Offset of the byte that is locked, far after the end of the text. Windows refuses to read a locked range,
but other processes must be able to read the holder's text."""


_LOCK_ATTEMPTS = 5
"""Number of attempts to lock a file that another start may be checking."""
_LOCK_PAUSE_S = 0.02
"""Seconds between two attempts. A check by another start is much shorter."""


class NameLock:
    """Holds the lock on an edge's name until closed.

    Raises:
        ResourceError: if a running edge of this machine has the name.
    """

    def __init__(self, name: str) -> None:
        readable = re.sub(r"[^A-Za-z0-9._-]", "_", name)
        # Append the original name in hexadecimal. Otherwise two different names with the same readable form
        # would share a lock.
        suffix = "" if readable == name else "-" + name.encode().hex()
        folder = _find_private_folder()
        self._path = folder / f"enliven-edge-{readable}{suffix}.lock"
        _remove_unlocked(folder)
        try:
            self._handle = _open_locked(self._path)
        except BlockingIOError as error:
            holder = error.strerror
            raise ResourceError(
                f"an edge named {name!r} runs on this machine already ({holder or 'unknown process'})",
                where="edge",
                remedy="Stop that edge, or start this edge with another --name.",
            ) from None
        # If the disk is full, the text is lost, but the name is still locked.
        with contextlib.suppress(OSError):
            os.ftruncate(self._handle, 0)
            os.lseek(self._handle, 0, os.SEEK_SET)
            os.write(self._handle, f"process {os.getpid()}".encode())

    def close(self) -> None:
        """Releases the name and removes its file. A second call does nothing."""
        if self._handle >= 0:
            with contextlib.suppress(OSError):
                if sys.platform == "win32":
                    os.ftruncate(self._handle, 0)
                else:
                    self._path.unlink()
            os.close(self._handle)
            self._handle = -1


def _open_locked(path: Path) -> int:
    """Returns a descriptor of the locked file, which is created if it is missing.

    Another start removes unlocked files. A file that was removed between opening and locking is created
    again.

    Raises:
        BlockingIOError: if a running process has locked the file. The error contains the holder's text.
    """
    for attempt in range(_LOCK_ATTEMPTS):
        handle = _open_file(path)
        try:
            _lock(handle)
        except OSError:
            holder = _read_holder(handle)
            os.close(handle)
            # If the lock file has no text, its holder is another process that is only checking it. So try
            # again.
            if holder or attempt == _LOCK_ATTEMPTS - 1:
                raise BlockingIOError(errno.EAGAIN, holder) from None
            time.sleep(_LOCK_PAUSE_S)
            continue
        if sys.platform == "win32" or _is_file_at(handle, path):
            return handle
        os.close(handle)
    raise BlockingIOError(errno.EAGAIN, "")


def _is_file_at(handle: int, path: Path) -> bool:
    """Returns True if an open file is still the file at a path."""
    try:
        return os.path.samestat(os.fstat(handle), path.lstat())
    except OSError:
        return False


def _remove_unlocked(folder: Path) -> None:
    """Removes the lock files of edges that were killed. The files of running edges are locked and stay."""
    if sys.platform == "win32":
        return
    with contextlib.suppress(OSError):
        for path in folder.glob("enliven-edge-*.lock"):
            with contextlib.suppress(OSError):
                handle = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC)
                try:
                    _lock(handle)
                    # Remove the text before the file, so that waiting processes do not read the text of an
                    # old holder.
                    os.ftruncate(handle, 0)
                    if _is_file_at(handle, path):
                        path.unlink()
                finally:
                    os.close(handle)


def _find_private_folder() -> Path:
    """Returns the user's runtime folder, or a private folder inside the temporary folder."""
    temporary = Path(tempfile.gettempdir())
    if sys.platform == "win32":
        return temporary
    session = os.environ.get("XDG_RUNTIME_DIR", "")
    if session and _is_own(Path(session)):
        return Path(session)
    folder = temporary / f"enliven-{os.getuid()}"
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700)
    if _is_own(folder):
        return folder
    raise ResourceError(
        "the folder of edge names belongs to another user, or other users may write to it",
        where=str(folder),
        remedy="Remove the folder, or set XDG_RUNTIME_DIR to a folder that only you can open.",
    )


def _is_own(folder: Path) -> bool:
    """Returns True for a real folder of this user, not a link, that no other user may write to."""
    try:
        file_status = folder.lstat()
    except OSError:
        return False
    user_id = file_status.st_uid == os.getuid() and not file_status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return stat.S_ISDIR(file_status.st_mode) and user_id


def _open_file(path: Path) -> int:
    """Returns a descriptor of the file, which is created if it is missing. Links are not followed."""
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
    except OSError as error:
        raise ResourceError(
            f"the lock file of the edge's name cannot be opened ({error.strerror})",
            where=str(path),
            remedy="Remove the lock file, or start the edge with another --name.",
        ) from None


def _read_holder(handle: int) -> str:
    """Returns the text that the holder wrote into the file."""
    os.lseek(handle, 0, os.SEEK_SET)
    return os.read(handle, 100).decode("ascii", "replace")


def _lock(handle: int) -> None:
    """Locks the file, or raises OSError immediately."""
    if sys.platform == "win32":
        os.lseek(handle, _LOCKED_BYTE, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
    else:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
