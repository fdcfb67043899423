"""Flushes a growing file to the disk periodically, on a separate thread."""

from __future__ import annotations

import contextlib
import errno
import os
import threading

from enliven.errors import ResourceError

SYNC_INTERVAL_S = 0.5
"""Seconds between two calls of fsync. A power cut may lose the data written in this time. On the disk of a
small computer one call takes up to a second, so it must not block the frame loop."""
_CLOSE_TIMEOUT_S = 1.0
"""Maximum seconds that closing waits for the last call."""
_UNSUPPORTED = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP}
"""Errors of a file system without fsync."""


class DiskSync:
    """Calls :func:`os.fsync` for a file periodically on its own thread.

    Args:
        descriptor: the descriptor of the open file. It may be closed at any time.
        every: seconds between two calls.

    Attributes:
        count: number of completed calls.
    """

    def __init__(self, descriptor: int, every: float = SYNC_INTERVAL_S) -> None:
        self._failure: OSError | None = None
        self.count = 0
        self._descriptor, self._every = os.dup(descriptor), every
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="disk", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Raises ResourceError if the disk failed to store written data."""
        if self._failure is not None:
            raise ResourceError(
                f"written data cannot be stored on the disk ({self._failure.strerror})",
                remedy="Check the disk and its free space.",
            )

    def close(self) -> None:
        """Calls fsync a last time, and waits up to a second for it. A second call of this method does
        nothing.
        """
        self._ended.set()
        if self._thread is not threading.current_thread():
            self._thread.join(_CLOSE_TIMEOUT_S)

    def _run(self) -> None:
        has_ended = False
        while not has_ended:
            has_ended = self._ended.wait(self._every)
            try:
                os.fsync(self._descriptor)
                self.count += 1
            except OSError as error:
                if error.errno not in _UNSUPPORTED:
                    self._failure = error
                break
        with contextlib.suppress(OSError):
            os.close(self._descriptor)
