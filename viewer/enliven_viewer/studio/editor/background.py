"""Long computations in a background thread."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from enliven.errors import EnlivenError
from enliven_viewer.language import tr
from enliven_viewer.studio.toasts import Toasts


class Cancelled(EnlivenError):
    """Raised in the thread of a computation that the artist has cancelled."""


class WorkProgress:
    """The progress of a computation, shared by its thread and the window.

    Attributes:
        share: finished fraction, 0 to 1; None if unknown.
        seconds: time since the start, as counted by the window.
        cancelled: whether the artist has cancelled it.
    """

    def __init__(self) -> None:
        self.share: float | None = None
        self.seconds = 0.0
        self.cancelled = False

    def report(self, fraction: float) -> None:
        """Reports the progress. Call it often, so that cancelling is quick.

        Raises:
            Cancelled: if the artist has cancelled it.
        """
        self.share = min(max(fraction, 0.0), 1.0)
        if self.cancelled:
            raise Cancelled("the work was cancelled")


class BackgroundTask:
    """Runs one computation at a time. :meth:`poll` passes on its result between two frames.

    Args:
        toasts: shows messages about starts and errors.
        busy: message shown if other work is requested meanwhile.
    """

    def __init__(self, toasts: Toasts, busy: str) -> None:
        self._toasts, self._busy = toasts, busy
        self._pool: ThreadPoolExecutor | None = None
        self._running_work: tuple[Future[Any], Callable[[Any], object]] | None = None
        self.progress: WorkProgress | None = None  # None if the work cannot be cancelled.
        self.message = ""

    @property
    def busy(self) -> bool:
        """Returns True if a computation is running."""
        return self._running_work is not None

    def begin(
        self,
        message: str,
        work: Callable[[], Any],
        then: Callable[[Any], object],
        progress: WorkProgress | None = None,
    ) -> None:
        """Starts ``work`` in the background thread. ``then`` gets its result in the window's thread.

        Args:
            progress: progress to display, if the work can be cancelled.
        """
        if self._running_work is not None:
            self._toasts.show_message(self._busy, tr("Wait until that work is done."))
            return
        self._pool = self._pool or ThreadPoolExecutor(1, "background task")
        self._running_work = (self._pool.submit(work), then)
        self.progress, self.message = progress, message
        self._toasts.show_message(f"{message} ...", tr("You can go on working."))

    def cancel(self) -> None:
        """Cancels the computation. Its result is discarded, and other work can start at once."""
        if self._running_work is None or self.progress is None:
            return
        self.progress.cancelled = True
        self._running_work, self.progress = None, None
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._pool = None
        self._toasts.show_message(
            tr("Cancelled: {0}{1}", self.message[:1].lower(), self.message[1:]), tr("Nothing was changed.")
        )

    def poll(self) -> None:
        """Passes on a finished result, or shows its error. Call once per frame."""
        if self._running_work is None or not self._running_work[0].done():
            return
        (work, then), self._running_work = self._running_work, None
        self.progress = None
        error = work.exception()
        if error is None:
            then(work.result())
        else:
            self._toasts.show_any_error(error, tr("Nothing was changed."))

    def finish(self) -> None:
        """Waits until the computation has finished. Used before the window closes, and in sessions without a
        window.
        """
        if self._running_work is not None:
            self._running_work[0].exception()
            self.poll()
