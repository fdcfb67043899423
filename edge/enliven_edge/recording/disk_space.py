"""Keeps space free on the disk of a recording: a thread deletes its oldest parts."""

from __future__ import annotations

import contextlib
import io
import logging
import re
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.records import Header

from enliven.recording import MAGIC
from enliven.supervision.closeable import Closeable

log = logging.getLogger(__name__)

CHECK_INTERVAL_S = 2.0
"""Seconds between two checks of the disk. It is short enough, because a take grows by less than 1 MB/s."""
_MIN_AGE_S = 60.0
"""Minimum seconds since the last write to a file that may be deleted. Another program may still write a newer
one."""
_RESUME_FACTOR = 1.02
"""A paused recording resumes if the free space exceeds the space to keep free by this factor. Without a
margin, it would pause and resume with every file that another program writes."""
_HEADER_BYTES = 512
"""Number of bytes at the start of a file that are read to find a recording's header."""
_OWN_LIBRARY = "enliven "
"""Beginning of the library's name in the header of a recording that enliven wrote."""


def name_expression(pattern: Path) -> re.Pattern[str]:
    """Returns the expression for all file names that a recording with this pattern can have.

    The path ``pattern`` may contain the placeholders of :func:`~enliven_edge.recording.parts.free_path`.
    """
    stem = re.escape(pattern.stem).replace(r"\{time\}", r"\d{8}-\d{6}").replace(r"\{number\}", r"\d{3,}")
    return re.compile(rf"{stem}(-\d+)?(-part\d+)?{re.escape(pattern.suffix)}")


def list_recorded_parts(pattern: Path) -> list[Path]:
    """Returns the files that enliven recorded with this name pattern, the oldest first.

    Links, folders, and files of other programs are excluded even if their names match.
    """
    expression, parts = name_expression(pattern), []
    with contextlib.suppress(OSError):
        for path in pattern.parent.iterdir():
            if expression.fullmatch(path.name) and not path.is_symlink() and path.is_file() and _is_own(path):
                parts.append((path.stat().st_mtime_ns, path.name, path))
    return [path for *_, path in sorted(parts)]


def _is_own(path: Path) -> bool:
    """Returns True if the header of a file states that enliven wrote it."""
    try:
        with path.open("rb") as file:
            header = file.read(_HEADER_BYTES)
        if not header.startswith(MAGIC):
            return False
        # The header is the first record: its code (1 byte), its length (8 bytes), and its fields.
        data = header[len(MAGIC) + 9 :]
        return Header.read(ReadDataStream(io.BytesIO(data))).library.startswith(_OWN_LIBRARY)
    except (OSError, McapError, UnicodeDecodeError, ValueError):
        return False


class DiskSpaceGuard(Closeable):
    """Deletes the oldest parts of a recording when the disk has too little free space.

    Only files that :func:`list_recorded_parts` returns are deleted, except those in :attr:`in_use`.

    Args:
        pattern: path of the recording, with placeholders.
        keep_free_bytes: space to keep free.
        free_bytes: returns the free space on the disk of a folder, for tests.

    Attributes:
        in_use: the files that are being written.
        is_short: whether the free space is too small and no file is left to delete.
    """

    def __init__(
        self,
        pattern: Path,
        keep_free_bytes: float,
        free_bytes: Callable[[Path], int] = lambda folder: shutil.disk_usage(folder).free,
    ) -> None:
        self._pattern, self._keep_free_bytes, self._free_bytes = pattern, keep_free_bytes, free_bytes
        self.in_use: frozenset[Path] = frozenset()
        self.is_short = False
        self._ended = threading.Event()
        self.check()
        self._thread = threading.Thread(target=self._run, name="disk space", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Deletes parts until there is enough space."""
        try:
            missing_bytes = self._keep_free_bytes - self._free_bytes(self._pattern.parent)
            for path in list_recorded_parts(self._pattern) if missing_bytes > 0 else ():
                if missing_bytes <= 0:
                    break
                if path in self.in_use or abs(time.time() - path.stat().st_mtime) < _MIN_AGE_S:
                    continue
                path.unlink()
                log.warning("%s was deleted, because the disk is nearly full", path)
                missing_bytes = self._keep_free_bytes - self._free_bytes(self._pattern.parent)
        except OSError as error:
            log.debug("the free space of the disk cannot be read: %s", error)
            return
        margin = (_RESUME_FACTOR - 1.0) * self._keep_free_bytes if self.is_short else 0.0
        self.is_short = missing_bytes > -margin

    def close(self) -> None:
        """Ends the thread. A second call does nothing."""
        self._ended.set()
        self._thread.join(CHECK_INTERVAL_S)

    def _run(self) -> None:
        while not self._ended.wait(CHECK_INTERVAL_S):
            self.check()
