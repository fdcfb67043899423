"""Splits a kernel's range of vertices between two threads. Small meshes stay in one thread."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from enliven.kernels import run_in_pieces

_RANGE_PIECES = 8
"""Number of pieces of a range. If one thread is delayed, the other thread can process most of the pieces."""
_BLOCK_VERTICES = 64
"""The number of vertices in a piece is a multiple of this block size of the kernels."""
_MIN_THREADED_VERTICES = 4000
"""Minimum number of vertices for two threads. With fewer vertices, waking the second thread takes as long as
it saves."""
_RETIMING_CALLS = 40
"""Number of calls after which the slower thread count is timed again."""
_TIME_INFLATION_FACTOR = 1.01
"""Factor that raises the recorded times at each call, so that a past load is forgotten after about 70
calls."""


class ThreadChoice:
    """A choice of one or two threads by their recent times, because a second thread is faster only on idle
    cores.

    Both thread counts are timed, and the recently faster count is used. The slower count is timed again every
    ``_RETIMING_CALLS`` calls.
    """

    def __init__(self) -> None:
        self._least = [math.inf, math.inf]
        self._calls = 0

    def choose_thread_count(self) -> int:
        """Returns the number of threads for the next call, 1 or 2."""
        self._calls += 1
        faster = 1 if self._least[0] <= self._least[1] else 2
        unknown = math.inf in self._least and self._calls > 1
        return 3 - faster if unknown or self._calls % _RETIMING_CALLS == 0 else faster

    def record_duration(self, threads: int, seconds: float) -> None:
        """Records the duration in seconds of a call with this number of threads."""
        self._least = [duration * _TIME_INFLATION_FACTOR for duration in self._least]
        self._least[threads - 1] = min(seconds, self._least[threads - 1])


def run_on_threads(kernel: Callable[..., Any], count: int, threads: int, *arguments: Any) -> None:
    """Runs ``kernel(*arguments, first, last)`` over the range from 0 to ``count``, on one or two threads."""
    if threads < 2 or count < _MIN_THREADED_VERTICES:
        kernel(*arguments, 0, count)
        return
    length = -(-count // (_RANGE_PIECES * _BLOCK_VERTICES)) * _BLOCK_VERTICES
    run_in_pieces(kernel, count, length, *arguments)
