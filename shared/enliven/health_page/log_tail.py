"""The newest lines of the log: from systemd's journal, or else from log files in the user's data folder."""

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
"""Names of the systemd units with the programs of enliven."""
MAX_LINES = 100
"""Number of lines."""
_MAX_LINE_LENGTH = 500
"""Maximum length of a line. The rest is cut off."""
_MAX_TAIL_BYTES = 64 * 1024
"""Maximum bytes that are read at the end of a file: 100 lines of 500 characters."""
_JOURNAL_TIMEOUT_S = 5.0
"""Longest wait for the journal, in seconds: reading a large one from a slow card takes a second."""
_MIN_INTERVAL_S = 5.0
"""Minimum time between two reads of the journal, in seconds. Each starts a process."""


class LogTail:
    """The newest lines of the log. They are read again at most every few seconds.

    Args:
        folder: folder with log files (``*.log``). None: ``logs`` in the user's data folder.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder or user_data_folder() / "logs"
        self._read_s = -_MIN_INTERVAL_S
        self._lines: list[str] = []

    def read(self) -> list[str]:
        """Returns the lines, the oldest first. May block for some seconds. Empty: no log is known."""
        time_now = time.monotonic()
        if time_now - self._read_s >= _MIN_INTERVAL_S:
            self._read_s = time_now
            self._lines = [
                escape_text(line)[:_MAX_LINE_LENGTH] for line in _read_journal() or _read_files(self._folder)
            ]
        return self._lines


def _read_journal() -> list[str]:
    """Returns the newest lines of enliven's units in systemd's journal."""
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
    """Returns the newest lines of the newest log files of a folder, each after the name of its file."""
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
