"""Transfers Python's traceback of a crashed process through a pipe.

So a process that ends normally leaves no file.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext

_MAX_BYTES = 1 << 16
"""Maximum bytes of a report. A pipe can buffer this number without a reader."""


class CrashTraceback:
    """The reading end of a pipe through which a crashed sensor process sends its traceback.

    On systems without such pipes, there is never a traceback.
    """

    def __init__(self, context: SpawnContext) -> None:
        self._near: Connection | None = None
        self.far: Connection | None = None
        if os.name == "posix":
            self._near, self.far = context.Pipe(duplex=False)
            os.set_blocking(self._near.fileno(), False)

    def close_child_end(self) -> None:
        """Closes the process's end of the pipe in the edge, because the process now has its own copy."""
        if self.far is not None:
            self.far.close()

    def read(self) -> str:
        """Returns the report, or an empty string without a crash.

        Call it once, after the process has ended.
        """
        if self._near is None:
            return ""
        report = b""
        with contextlib.suppress(OSError), self._near:
            while len(report) < _MAX_BYTES and (chunk := os.read(self._near.fileno(), _MAX_BYTES)):
                report += chunk
        return report.decode(errors="replace")

    def close(self) -> None:
        """Closes the pipe. A second call does nothing."""
        if self._near is not None:
            self._near.close()


def enable_crash_report(pipe: Connection | None) -> None:
    """Makes Python write the report of a crash of this process to the pipe, which must be kept open."""
    if pipe is not None:
        # Do not block on writing, because the reader of a crashing process may be missing.
        os.set_blocking(pipe.fileno(), False)
        faulthandler.enable(file=pipe.fileno())
