"""What Python says of a process that crashes, through a pipe: one that ends well leaves no file."""

from __future__ import annotations

import contextlib
import faulthandler
import os
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext

_MOST_BYTES = 1 << 16
"""Bytes of a report: a pipe holds so many without a reader."""


class LastWords:
    """The end of the pipe that the edge reads; on systems without such pipes nothing is ever said."""

    def __init__(self, context: SpawnContext) -> None:
        self._near: Connection | None = None
        self.far: Connection | None = None
        if os.name == "posix":
            self._near, self.far = context.Pipe(duplex=False)
            os.set_blocking(self._near.fileno(), False)

    def started(self) -> None:
        """The process has its own end now."""
        if self.far is not None:
            self.far.close()

    def read(self) -> str:
        """What was said; empty where nothing was. To be called once, after the process has ended."""
        if self._near is None:
            return ""
        said = b""
        with contextlib.suppress(OSError), self._near:
            while len(said) < _MOST_BYTES and (more := os.read(self._near.fileno(), _MOST_BYTES)):
                said += more
        return said.decode(errors="replace")

    def close(self) -> None:
        """Lets the pipe go; a second call does nothing."""
        if self._near is not None:
            self._near.close()


def speak_into(far: Connection | None) -> None:
    """From now on a crash of this process is told through the pipe, which must be kept."""
    if far is not None:
        # A dying process never waits for a reader.
        os.set_blocking(far.fileno(), False)
        faulthandler.enable(file=far.fileno())
