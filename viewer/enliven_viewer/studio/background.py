"""Work that takes long, done in a thread beside the window."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from enliven_viewer.studio.toasts import Toasts


class BackgroundTask:
    """Does one piece of work at a time; its result is taken between two pictures.

    Args:
        toasts: where it is told that work began, and what went wrong.
        busy: what is said where other work is wanted meanwhile.
    """

    def __init__(self, toasts: Toasts, busy: str) -> None:
        self._toasts, self._busy = toasts, busy
        self._pool: ThreadPoolExecutor | None = None
        self._work: tuple[Future[Any], Callable[[Any], object]] | None = None

    @property
    def busy(self) -> bool:
        """Whether something is being done."""
        return self._work is not None

    def begin(self, said: str, work: Callable[[], Any], then: Callable[[Any], object]) -> None:
        """Begin ``work`` in the thread; ``then`` takes its result in the window's own."""
        if self._work is not None:
            self._toasts.say(self._busy, "Wait until it is done.")
            return
        self._pool = self._pool or ThreadPoolExecutor(1, "beside the window")
        self._work = (self._pool.submit(work), then)
        self._toasts.say(f"{said} ...", "You can go on working.")

    def poll(self) -> None:
        """Take a finished result, or tell what went wrong; to be called once a picture."""
        if self._work is None or not self._work[0].done():
            return
        (work, then), self._work = self._work, None
        error = work.exception()
        if error is None:
            then(work.result())
        else:
            self._toasts.tell(error, "Nothing was changed.")

    def finish(self) -> None:
        """Wait for it: before the window ends, and in sessions without a window."""
        if self._work is not None:
            self._work[0].exception()
            self.poll()
