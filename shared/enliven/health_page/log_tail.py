"""Reads the newest lines of the log from systemd's journal, or otherwise from log files in the user's data
folder."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import time
from pathlib import Path

from enliven.files import user_data_folder
from enliven.logs import escape_text

UNIT_PATTERN = "enliven*"
"""Pattern of the names of enliven's systemd units."""
MAX_LINES = 100
"""Maximum number of lines that are shown."""
_MAX_LINE_LENGTH = 500
"""Maximum length of a line in characters. Longer lines are truncated."""
_MAX_TAIL_BYTES = 64 * 1024
"""Maximum number of bytes that are read at the end of a file. It is enough for 100 lines of 500
characters."""
_JOURNAL_TIMEOUT_S = 5.0
"""Timeout of reading the journal, in seconds. Reading a large journal from a slow memory card takes a
second."""
_MIN_INTERVAL_S = 5.0
"""Minimum interval between two reads of the journal, in seconds. It is limited, because each read starts a
process."""


class LogTail:
    """The newest lines of the log. They are read again at most every few seconds.

    Args:
        folder: folder with log files (``*.log``). None means ``logs`` in the user's data folder.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder or user_data_folder() / "logs"
        self._read_s = -_MIN_INTERVAL_S
        self._lines: list[str] = []

    def read(self) -> list[str]:
        """Returns the newest lines, the oldest first. The list is empty if no log exists. May block for some
        seconds."""
        time_now = time.monotonic()
        if time_now - self._read_s >= _MIN_INTERVAL_S:
            self._read_s = time_now
            self._lines = [
                escape_text(line)[:_MAX_LINE_LENGTH] for line in _read_journal() or _read_files(self._folder)
            ]
        return self._lines


def _read_journal() -> list[str]:
    """Returns the newest lines of enliven's systemd units from the journal."""
    program = shutil.which("journalctl")
    if program is None:
        return []
    options = [f"--lines={MAX_LINES}", "--output=short-iso", "--no-pager", "--quiet", "--unit", UNIT_PATTERN]
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        output = subprocess.run(
            [program, *options], capture_output=True, timeout=_JOURNAL_TIMEOUT_S, check=True
        ).stdout
        return output.decode("utf-8", "replace").splitlines()[-MAX_LINES:]
    return []


def _read_files(folder: Path) -> list[str]:
    """Returns the newest lines of the newest log files in a folder. Each line is prefixed by the name of its
    file."""
    lines: list[str] = []
    with contextlib.suppress(OSError):
        paths = sorted(folder.glob("*.log"), key=lambda path: path.stat().st_mtime)
        for path in paths[-MAX_LINES:]:
            with contextlib.suppress(OSError):
                lines += [f"{path.stem}: {line}" for line in _read_tail(path)]
    return lines[-MAX_LINES:]


def _read_tail(path: Path) -> list[str]:
    """Returns the complete lines at the end of a file."""
    if not path.is_file():
        return []
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - _MAX_TAIL_BYTES))
        data = file.read(_MAX_TAIL_BYTES)
    lines = data.decode("utf-8", "replace").splitlines()
    return lines[1:] if size > _MAX_TAIL_BYTES else lines
