"""A worker thread for calls that may block: one call at a time, with a timeout for the caller."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Any

log = logging.getLogger(__name__)


class Errands:
    """Runs one call at a time on a daemon thread; the caller waits for the answer with a timeout.

    The thread begins a call only when it is asked, so that no answer is older than without it.
    """

    def __init__(self, name: str) -> None:
        self._calls: SimpleQueue[Callable[[], Any] | None] = SimpleQueue()
        self._answers: SimpleQueue[tuple[Any, Exception | None]] = SimpleQueue()
        self._since: float | None = None
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    @property
    def busy(self) -> bool:
        """Whether a call has been asked and its answer not been taken."""
        return self._since is not None

    @property
    def alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive()

    @property
    def waited(self) -> float:
        """Seconds since the open call was asked; 0 without one."""
        return 0.0 if self._since is None else time.monotonic() - self._since

    def ask(self, call: Callable[[], Any]) -> None:
        """Starts a call; the answer to the one before must have been taken."""
        self._since = time.monotonic()
        self._calls.put(call)

    def answer(self, timeout: float | None) -> Any:
        """The result of the call.

        Returns:
            None where the thread was ended before.

        Raises:
            TimeoutError: where it has not ended within ``timeout`` seconds; the answer may come later.
            Exception: what the call raised.
        """
        try:
            result, error = self._answers.get(timeout=timeout)
        except Empty:
            raise TimeoutError("no answer yet") from None
        self._since = None
        if error is not None:
            raise error
        return result

    def finish(self, last: Callable[[list[Any]], None], timeout: float = 0.0) -> bool:
        """Ends the thread after the current call.

        Args:
            last: called on the thread at its end, with the answers that were not taken.
            timeout: seconds to wait for that.

        Returns:
            whether the thread has ended.
        """
        self._calls.put(lambda: last(self._left()))
        self._calls.put(None)
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _left(self) -> list[Any]:
        left = []
        while not self._answers.empty():
            left.append(self._answers.get()[0])
        return left

    def _work(self) -> None:
        while (call := self._calls.get()) is not None:
            try:
                answer: tuple[Any, Exception | None] = call(), None
            except Exception as error:
                log.debug("%s", self._thread.name, exc_info=True)
                answer = None, error
            self._answers.put(answer)
        # An answer that is still waited for may have been among those left over.
        self._answers.put((None, None))
