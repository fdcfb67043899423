"""A file of whole records only: a record that did not fit is removed again."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path


class WholeFile:
    """A file for writing, as :class:`mcap.writer.Writer` needs one; every write goes to the operating system.

    After a write that failed, half of it on the disk, the file ends where it did before, and is closed.

    Raises:
        OSError: where the file cannot be made.
    """

    def __init__(self, path: Path, mode: str) -> None:
        self._raw = path.open(mode, buffering=0)
        self._end = 0

    def move(self, path: Path) -> None:
        """Continues in ``path``, where the bytes written before were moved or copied.

        Raises:
            OSError: where that file cannot be opened.
        """
        if not os.path.samestat(os.fstat(self._raw.fileno()), path.stat()):
            self._raw.close()
            self._raw = path.open("r+b", buffering=0)
            self._raw.seek(self._end)

    @property
    def closed(self) -> bool:
        """Whether nothing more can be written."""
        return self._raw.closed

    def fileno(self) -> int:
        """The descriptor, for :func:`os.fsync`."""
        return self._raw.fileno()

    def tell(self) -> int:
        """Bytes written."""
        return self._end

    def write(self, data: bytes) -> int:
        """Writes all of the bytes, or none of them.

        Raises:
            OSError: where the disk is full or the like; the file is closed then.
        """
        left = memoryview(data)
        try:
            while left:
                left = left[self._raw.write(left) :]
        except OSError:
            self._take_back()
            raise
        self._end += len(data)
        return len(data)

    def flush(self) -> None:
        """Does nothing: no bytes are buffered here."""

    def close(self) -> None:
        """Closes the file; a second call does nothing."""
        self._raw.close()

    def _take_back(self) -> None:
        """Truncates the file to its last whole record."""
        with contextlib.suppress(OSError):
            os.ftruncate(self._raw.fileno(), self._end)
        with contextlib.suppress(OSError):
            self._raw.close()
