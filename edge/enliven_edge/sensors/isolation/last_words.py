"""Python's report of a crashed process, through a pipe: a process that ends well leaves no file."""

from __future__ import annotations

import contextlib
import faulthandler
import os
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext

_MOST_BYTES = 1 << 16
"""Bytes of a report: a pipe holds so many without a reader."""


class LastWords:
    """The edge's end of the pipe; on systems without such pipes there is never a report."""

    def __init__(self, context: SpawnContext) -> None:
        self._near: Connection | None = None
        self.far: Connection | None = None
        if os.name == "posix":
            self._near, self.far = context.Pipe(duplex=False)
            os.set_blocking(self._near.fileno(), False)

    def started(self) -> None:
        """Closes the process's end in the edge: the process has its own now."""
        if self.far is not None:
            self.far.close()

    def read(self) -> str:
        """The report, empty without a crash. To be called once, after the process has ended."""
        if self._near is None:
            return ""
        said = b""
        with contextlib.suppress(OSError), self._near:
            while len(said) < _MOST_BYTES and (more := os.read(self._near.fileno(), _MOST_BYTES)):
                said += more
        return said.decode(errors="replace")

    def close(self) -> None:
        """Closes the pipe; a second call does nothing."""
        if self._near is not None:
            self._near.close()


def speak_into(far: Connection | None) -> None:
    """Sends the report of a crash of this process through the pipe, which must be kept."""
    if far is not None:
        # A dying process never waits for a reader.
        os.set_blocking(far.fileno(), False)
        faulthandler.enable(file=far.fileno())
