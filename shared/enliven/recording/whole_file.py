"""A file that contains only complete records. After a failed write, the incomplete record is removed."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path


class WholeFile:
    """A file for writing with the methods that :class:`mcap.writer.Writer` needs.

    Every write is passed to the operating system immediately.

    After a failed write, a part of it may be on the disk. So the file is truncated to its previous end and
    closed.

    Raises:
        OSError: if the file cannot be created.
    """

    def __init__(self, path: Path, mode: str) -> None:
        self._raw = path.open(mode, buffering=0)
        self._end = 0

    def move(self, path: Path) -> None:
        """Continues writing to the file ``path``, to which the caller has already moved or copied the written
        bytes.

        Raises:
            OSError: if that file cannot be opened.
        """
        if not os.path.samestat(os.fstat(self._raw.fileno()), path.stat()):
            self._raw.close()
            self._raw = path.open("r+b", buffering=0)
            self._raw.seek(self._end)

    @property
    def closed(self) -> bool:
        """True if no more bytes can be written."""
        return self._raw.closed

    def fileno(self) -> int:
        """Returns the file's descriptor for :func:`os.fsync`."""
        return self._raw.fileno()

    def tell(self) -> int:
        """Returns the number of written bytes."""
        return self._end

    def write(self, data: bytes) -> int:
        """Writes all bytes, or none of them.

        Raises:
            OSError: if writing fails, for example because the disk is full. The file is then closed.
        """
        remaining = memoryview(data)
        try:
            while remaining:
                remaining = remaining[self._raw.write(remaining) :]
        except OSError:
            self._truncate()
            raise
        self._end += len(data)
        return len(data)

    def flush(self) -> None:
        """Does nothing: no bytes are buffered here."""

    def close(self) -> None:
        """Closes the file. A second call does nothing."""
        self._raw.close()

    def _truncate(self) -> None:
        """Truncates the file to its last complete record."""
        with contextlib.suppress(OSError):
            os.ftruncate(self._raw.fileno(), self._end)
        with contextlib.suppress(OSError):
            self._raw.close()
