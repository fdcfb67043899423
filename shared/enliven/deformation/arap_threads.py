"""A kernel's range of vertices shared between two threads.

The kernels give up the lock of the interpreter and are serial themselves: calling parallel kernels from
several threads of one process is not safe everywhere. The range is cut into pieces that each thread takes
when it has nothing else to do, so that a second processor core that is busy with others costs less. Small
meshes stay in one thread. Each piece writes its own vertices only, so the answer is the same.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

_PIECES = 8
_BLOCK = 64
_SMALL = 4000


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
