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
_BLOCK = 64
_SMALL = 4000
_ASKED, _FORGOTTEN = 40, 1.01
"""Calls after which the way that seemed slower is tried again, and how fast old times are forgotten."""


class ThreadChoice:
    """Whether a second thread pays just now: on idle cores it does, beside other work it costs.

    Both ways are timed, the one that was faster of late is taken, and the other is asked again now and then.
    """

    def __init__(self) -> None:
        self._least = [math.inf, math.inf]
        self._calls = 0

    def threads(self) -> int:
        """How many to take for the next call, 1 or 2."""
        self._calls += 1
        faster = 1 if self._least[0] <= self._least[1] else 2
        unknown = math.inf in self._least and self._calls > 1
        return 3 - faster if unknown or self._calls % _ASKED == 0 else faster

    def note(self, threads: int, seconds: float) -> None:
        """How long a call with so many threads took."""
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
