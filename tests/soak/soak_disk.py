"""The disk for a soak's recordings, which can be filled and freed."""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import subprocess
from pathlib import Path

SIZE_MB = 48
"""Size of the disk, MB."""


class TakeDisk:
    """A small file system in memory for the takes, if this user may mount one.

    Otherwise a full disk is imitated by a limit of the file size of the edge's process.

    Attributes:
        kind: which of the two methods is used, for the report.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        command = ["mount", "-t", "tmpfs", "-o", f"size={SIZE_MB}m", "tmpfs", str(folder)]
        self._mounted = (
            hasattr(os, "geteuid")
            and os.geteuid() == 0
            and shutil.which("mount") is not None
            and subprocess.run(command, capture_output=True).returncode == 0
        )
        self.kind = f"a tmpfs of {SIZE_MB} MB" if self._mounted else "a limit of the file size"

    def fill(self, pid: int) -> None:
        """Leaves the process no space to write."""
        if not self._mounted:
            self._limit(pid, 1 << 20)
            return
        with contextlib.suppress(OSError), (self.folder / "filler").open("wb", buffering=0) as filler:
            while True:
                filler.write(bytes(1 << 16))

    def free(self, pid: int) -> None:
        """Makes space again and removes old takes."""
        if self._mounted:
            (self.folder / "filler").unlink(missing_ok=True)
        else:
            self._limit(pid, resource.RLIM_INFINITY)
        self.remove_old_takes()

    def remove_old_takes(self) -> None:
        """Removes all takes except the newest, like a person who moves them away in the evening."""
        takes = sorted(self.folder.glob("*.mcap"), key=lambda path: path.stat().st_mtime)
        for path in takes[:-1]:
            path.unlink()

    def close(self) -> None:
        if self._mounted:
            subprocess.run(["umount", "-l", str(self.folder)], capture_output=True)

    @staticmethod
    def _limit(pid: int, size: int) -> None:
        with contextlib.suppress(OSError):
            _, hard = resource.prlimit(pid, resource.RLIMIT_FSIZE)
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (size, hard))
