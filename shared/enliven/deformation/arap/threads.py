"""A kernel's range of vertices shared between two threads.

The kernels give up the lock of the interpreter and are serial themselves: calling parallel kernels from
several threads of one process is not safe everywhere. The range is cut into pieces that each thread takes
when it has nothing else to do, so that a second processor core that is busy with others costs less. Small
meshes stay in one thread. Each piece writes its own vertices only, so the answer is the same.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

_PIECES = 8
"""Pieces of a range: enough that a thread that is held up leaves most of them to the other."""
_BLOCK = 64
"""Vertices that a piece is a multiple of: the kernels work on blocks of so many cells."""
_SMALL = 4000
"""Vertices below which a range stays in one thread: waking the second costs as much as it saves."""
_RETRIED = 40
"""Calls after which the count of threads that was slower is timed again."""
_FORGOTTEN = 1.01
"""Factor on the least times with each call, so that a load that ended is forgotten within some 70 calls."""


class ThreadChoice:
    """Chooses one thread or two by their last times: a second thread is faster on idle cores only.

    Both counts are timed, the faster of late is taken, and the other is timed again now and then.
    """

    def __init__(self) -> None:
        self._least = [math.inf, math.inf]
        self._calls = 0

    def threads(self) -> int:
        """The number of threads for the next call, 1 or 2."""
        self._calls += 1
        faster = 1 if self._least[0] <= self._least[1] else 2
        unknown = math.inf in self._least and self._calls > 1
        return 3 - faster if unknown or self._calls % _RETRIED == 0 else faster

    def note(self, threads: int, seconds: float) -> None:
        """Record the seconds that a call with so many threads took."""
        self._least = [least * _FORGOTTEN for least in self._least]
        self._least[threads - 1] = min(seconds, self._least[threads - 1])


@cache
def _second() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, "enliven-arap")


def shared(kernel: Callable[..., Any], count: int, threads: int, *arguments: Any) -> None:
    """``kernel(*arguments, first, last)`` over 0 to ``count``, in one or two threads."""
    if threads < 2 or count < _SMALL:
        kernel(*arguments, 0, count)
        return
    length = -(-count // (_PIECES * _BLOCK)) * _BLOCK
    pieces = deque(range(0, count, length))

    def work(take: Callable[[], int]) -> None:
        while True:
            try:
                first = take()
            except IndexError:
                return
            kernel(*arguments, first, min(first + length, count))

    other = _second().submit(work, pieces.pop)
    work(pieces.popleft)
    if not other.cancel():
        other.result()
