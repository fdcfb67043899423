"""Exports files in a thread beside the window, since baking puppets takes long."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

from enliven.errors import EnlivenError
from enliven_viewer.studio.toasts import Toasts

log = logging.getLogger(__name__)


class Exporting:
    """Runs one export at a time in a thread, and tells the result when it is done."""

    def __init__(self, toasts: Toasts) -> None:
        self._toasts = toasts
        self._pool: ThreadPoolExecutor | None = None
        self._future: Future[str] | None = None

    @property
    def busy(self) -> bool:
        """Whether an export is running."""
        return self._future is not None

    def begin(self, name: str, write: Callable[[], str]) -> None:
        """Write beside the window; ``write`` returns what to say of it."""
        if self._future is not None:
            self._toasts.say("An export is still being written", "Wait until it is done.")
            return
        self._pool = self._pool or ThreadPoolExecutor(1, thread_name_prefix="exporting")
        self._future = self._pool.submit(write)
        self._toasts.say(f"Writing {name} ...", "You can go on working.")

    def poll(self) -> None:
        """Tell the result of a finished export; to be called once a picture."""
        future = self._future
        if future is None or not future.done():
            return
        self._future = None
        error = future.exception()
        if error is None:
            said, _, rest = future.result().partition(". ")
            self._toasts.say(said, rest)
        elif isinstance(error, EnlivenError):
            self._toasts.complain(error)
        else:
            log.error("an export failed", exc_info=error)
            what = f"a fault of enliven itself: {type(error).__name__}: {error}"
            self._toasts.complain(EnlivenError(what, mend="Nothing was written."))

    def finish(self) -> None:
        """Wait for the export: before the window ends, and in sessions without a window."""
        if self._future is not None:
            self._future.exception()
            self.poll()
