"""A kernel's range shared between two threads.

The kernels give up the lock of the interpreter and are serial themselves, for parallel kernels may not be
called from several threads of one process everywhere. The range is cut into pieces that each thread takes
when it has nothing else to do; a piece writes to its own places only, so that the answer is always the same.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any


@cache
def _second() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, "enliven-scanning")


def in_pieces(kernel: Callable[..., Any], count: int, length: int, *arguments: Any) -> None:
    """Calls ``kernel(*arguments, first, last)`` for pieces of ``length`` that cover 0 to ``count``."""
    pieces = deque(range(0, count, length))

    def work(take: Callable[[], int]) -> None:
        while True:
            try:
                first = take()
            except IndexError:
                return
            kernel(*arguments, first, min(first + length, count))

    if len(pieces) < 2:
        work(pieces.popleft)
        return
    other = _second().submit(work, pieces.pop)
    work(pieces.popleft)
    if not other.cancel():
        other.result()
