"""Reserves a screen for one kiosk, by a locked file in the runtime folder."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

from enliven.errors import ResourceError
from enliven.supervision.records import runtime_folder

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl


class ScreenLock:
    """A lock on a screen until it is closed. The operating system releases the lock when the process ends,
    even after a crash.

    Args:
        number: number of the monitor.
        folder: folder of the lock file. None means the runtime folder.

    Raises:
        ResourceError: if another kiosk uses this screen.
    """

    def __init__(self, number: int, folder: Path | None = None) -> None:
        path = (folder or runtime_folder()) / f"screen-{number}.lock"
        self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            if sys.platform == "win32":
                msvcrt.locking(self._file, msvcrt.LK_NBLCK, 1)
            else:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._file)
            raise ResourceError(
                f"another kiosk already uses screen {number}",
                where="kiosk",
                remedy="Stop the other kiosk, or set another monitor in this profile: number under [screen].",
            ) from None

    def close(self) -> None:
        """Releases the screen."""
        with contextlib.suppress(OSError):
            os.close(self._file)


def is_screen_taken(number: int, folder: Path | None = None) -> bool:
    """Returns True if the window of a kiosk of this user has locked a screen.

    Args:
        number: number of the monitor.
        folder: folder of the lock file. None means the runtime folder.
    """
    try:
        ScreenLock(number, folder).close()
    except ResourceError:
        return True
    return False
