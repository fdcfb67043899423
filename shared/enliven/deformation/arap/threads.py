"""Splits a kernel's range of vertices between two threads.

The kernels release the global interpreter lock (GIL) and are serial themselves. Calling parallel kernels from
several threads of one process is not safe on every platform. The range is split into pieces, and each thread
takes the next piece when it is idle. So a second core that is busy with other work delays a call less. Small
meshes stay in one thread. Each piece writes only its own vertices, so the result is the same.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

_RANGE_PIECES = 8
"""Number of pieces of a range. If one thread is delayed, the other one can take most of the pieces."""
_BLOCK_VERTICES = 64
"""The number of vertices in a piece is a multiple of this block size of the kernels."""
_MIN_THREADED_VERTICES = 4000
"""Minimum number of vertices for two threads. Below it, waking the second thread costs as much as it
saves."""
_RETIMING_CALLS = 40
"""Number of calls after which the slower thread count is timed again."""
_TIME_INFLATION_FACTOR = 1.01
"""Factor on the minimum times at each call. So the effect of a past load vanishes within about 70 calls."""


class ThreadChoice:
    """A choice of one or two threads by their recent times, because a second thread is faster only on idle
    cores.

    Both counts are timed, the recently faster one is used, and the other is timed again now and then.
    """

    def __init__(self) -> None:
        self._least = [math.inf, math.inf]
        self._calls = 0

    def threads(self) -> int:
        """Returns the number of threads for the next call, 1 or 2."""
        self._calls += 1
        faster = 1 if self._least[0] <= self._least[1] else 2
        unknown = math.inf in self._least and self._calls > 1
        return 3 - faster if unknown or self._calls % _RETIMING_CALLS == 0 else faster

    def note(self, threads: int, seconds: float) -> None:
        """Records the seconds that a call with this number of threads took."""
        self._least = [least * _TIME_INFLATION_FACTOR for least in self._least]
        self._least[threads - 1] = min(seconds, self._least[threads - 1])


@cache
def _second_thread() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, "enliven-arap")


def run_on_threads(kernel: Callable[..., Any], count: int, threads: int, *arguments: Any) -> None:
    """Runs ``kernel(*arguments, first, last)`` over 0 to ``count``, in one or two threads."""
    if threads < 2 or count < _MIN_THREADED_VERTICES:
        kernel(*arguments, 0, count)
        return
    length = -(-count // (_RANGE_PIECES * _BLOCK_VERTICES)) * _BLOCK_VERTICES
    pieces = deque(range(0, count, length))

    def work(take: Callable[[], int]) -> None:
        while True:
            try:
                first = take()
            except IndexError:
                return
            kernel(*arguments, first, min(first + length, count))

    other = _second_thread().submit(work, pieces.pop)
    work(pieces.popleft)
    if not other.cancel():
        other.result()
