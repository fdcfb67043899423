"""A worker thread for blocking calls. It runs one call at a time, and the caller waits with a timeout."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Any

log = logging.getLogger(__name__)


class WorkerThread:
    """Runs one call at a time on a daemon thread. The caller waits for the answer with a timeout.

    The thread starts a call only on request. So answers are as recent as without a thread.
    """

    def __init__(self, name: str) -> None:
        self._calls: SimpleQueue[Callable[[], Any] | None] = SimpleQueue()
        self._answers: SimpleQueue[tuple[Any, Exception | None]] = SimpleQueue()
        self._since: float | None = None
        self._thread = threading.Thread(target=self._run_calls, name=name, daemon=True)
        self._thread.start()

    @property
    def is_busy(self) -> bool:
        """Returns True if a call was started and its answer was not taken yet."""
        return self._since is not None

    @property
    def is_alive(self) -> bool:
        """Returns True while the thread runs."""
        return self._thread.is_alive()

    @property
    def waiting_seconds(self) -> float:
        """Returns the seconds since the current call was started, or 0 if no call is running."""
        return 0.0 if self._since is None else time.monotonic() - self._since

    def start_call(self, call: Callable[[], Any]) -> None:
        """Starts a call. The answer of the previous call must have been taken."""
        self._since = time.monotonic()
        self._calls.put(call)

    def get_result(self, timeout: float | None) -> Any:
        """Returns the result of the call.

        Returns:
            the result, or None if the thread was ended before.

        Raises:
            TimeoutError: if the call has not ended within ``timeout`` seconds. The answer may arrive later.
            Exception: the exception of the call.
        """
        try:
            result, error = self._answers.get(timeout=timeout)
        except Empty:
            raise TimeoutError(f"the call did not finish within {timeout} s") from None
        self._since = None
        if error is not None:
            raise error
        return result

    def finish(self, last: Callable[[list[Any]], None], timeout: float = 0.0) -> bool:
        """Ends the thread after the current call.

        Args:
            last: called on the thread at its end, with the answers that were not taken.
            timeout: seconds to wait for the end.

        Returns:
            True if the thread has ended.
        """
        self._calls.put(lambda: last(self._take_remaining_answers()))
        self._calls.put(None)
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _take_remaining_answers(self) -> list[Any]:
        left = []
        while not self._answers.empty():
            left.append(self._answers.get()[0])
        return left

    def _run_calls(self) -> None:
        while (call := self._calls.get()) is not None:
            try:
                answer: tuple[Any, Exception | None] = call(), None
            except Exception as error:
                log.debug("%s", self._thread.name, exc_info=True)
                answer = None, error
            self._answers.put(answer)
        # ``finish`` may have discarded an answer for which a caller still waits. This empty answer releases
        # the caller.
        self._answers.put((None, None))
