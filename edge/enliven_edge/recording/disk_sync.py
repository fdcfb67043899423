"""Hands a file that grows to the disk at even intervals, on a thread of its own."""

from __future__ import annotations

import contextlib
import errno
import os
import threading

from enliven.errors import ResourceError

SYNC_EVERY = 5.0
"""Seconds between two calls of fsync: the part of a recording that a power cut may cost. A disk of a small
computer takes up to a second for one, which the frame loop must not wait for."""
_LAST = 1.0
"""Seconds for which closing waits for the last call."""
_NOT_THERE = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP}
"""Errors of a file system without fsync."""


class DiskSync:
    """Calls :func:`os.fsync` for a file at even intervals on a thread of its own.

    Args:
        descriptor: of the open file; it may be closed at any time.
        every: seconds between two calls.

    Attributes:
        count: how many calls have returned.
    """

    def __init__(self, descriptor: int, every: float = SYNC_EVERY) -> None:
        self._failure: OSError | None = None
        self.count = 0
        self._descriptor, self._every = os.dup(descriptor), every
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="disk", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Raises ResourceError where the disk refused written data."""
        if self._failure is not None:
            raise ResourceError(
                f"what was written does not reach the disk ({self._failure.strerror})",
                mend="Check the disk and its space.",
            )

    def close(self) -> None:
        """Calls it a last time, and waits a little for that; a second call does nothing."""
        self._ended.set()
        if self._thread is not threading.current_thread():
            self._thread.join(_LAST)

    def _run(self) -> None:
        ended = False
        while not ended:
            ended = self._ended.wait(self._every)
            try:
                os.fsync(self._descriptor)
                self.count += 1
            except OSError as error:
                if error.errno not in _NOT_THERE:
                    self._failure = error
                break
        with contextlib.suppress(OSError):
            os.close(self._descriptor)
