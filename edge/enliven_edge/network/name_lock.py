"""Allows one edge of a name on a machine by a locked file in a folder that only its user may write to.

The operating system drops the lock with its process, however that ends, so no name stays taken. In a folder
that all may write to a stranger could put a link in the file's place, and the file that it points to would be
emptied.
"""

from __future__ import annotations

import contextlib
import os
import re
import stat
import sys
import tempfile
from pathlib import Path

from enliven.errors import ResourceError

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

_LOCKED_BYTE = 1 << 30
"""Byte that is locked, far behind the text: Windows refuses to read a locked range, and others are to read
the holder."""


class NameLock:
    """Holds an edge's name until closed.

    Raises:
        ResourceError: where a living edge of this machine has the name.
    """

    def __init__(self, name: str) -> None:
        readable = re.sub(r"[^A-Za-z0-9._-]", "_", name)
        # Two names that read alike must not lock each other out.
        suffix = "" if readable == name else "-" + name.encode().hex()
        path = _own_folder() / f"enliven-edge-{readable}{suffix}.lock"
        self._handle = _opened(path)
        try:
            _lock(self._handle)
        except OSError:
            holder = _text(self._handle)
            os.close(self._handle)
            raise ResourceError(
                f"an edge named {name!r} runs on this machine already ({holder or 'unknown process'})",
                where="edge",
                mend="Stop it, or give this one another name with --name.",
            ) from None
        # A full disk takes the text, not the name.
        with contextlib.suppress(OSError):
            os.ftruncate(self._handle, 0)
            os.lseek(self._handle, 0, os.SEEK_SET)
            os.write(self._handle, f"process {os.getpid()}".encode())

    def close(self) -> None:
        """Releases the name; the empty file stays, since removing it could take it from the next holder."""
        if self._handle >= 0:
            with contextlib.suppress(OSError):
                os.ftruncate(self._handle, 0)
            os.close(self._handle)
            self._handle = -1


def _own_folder() -> Path:
    """Returns the user's folder for a session, or one in the temporary folder that only they may enter."""
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
        "the folder for the names of edges is not this user's own, or others may write to it",
        where=str(folder),
        mend="Remove it, or set XDG_RUNTIME_DIR to a folder that only you can enter.",
    )


def _is_own(folder: Path) -> bool:
    """Returns whether it is a folder, no link, of this user, that no other user may write to."""
    try:
        found = folder.lstat()
    except OSError:
        return False
    ours = found.st_uid == os.getuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return stat.S_ISDIR(found.st_mode) and ours


def _opened(path: Path) -> int:
    """Returns a descriptor of the file, created where it is missing, never through a link."""
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
    except OSError as error:
        raise ResourceError(
            f"the file that keeps the edge's name cannot be opened ({error.strerror})",
            where=str(path),
            mend="Remove that file, or give the edge another name with --name.",
        ) from None


def _text(handle: int) -> str:
    """Returns the text that the holder wrote into the file."""
    os.lseek(handle, 0, os.SEEK_SET)
    return os.read(handle, 100).decode("ascii", "replace")


def _lock(handle: int) -> None:
    """Takes the lock or raises OSError at once."""
    if sys.platform == "win32":
        os.lseek(handle, _LOCKED_BYTE, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
    else:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
