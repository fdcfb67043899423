"""Splits a kernel's range between two threads.

The kernels release the global interpreter lock (GIL) and are serial themselves, because parallel kernels
cannot be called from several threads of one process on every platform. The range is split into pieces, and
each thread takes the next piece when it is idle. A piece writes only to its own part of the output, so the
result is always the same.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, TypeVar, cast

T = TypeVar("T")
S = TypeVar("S")


@cache
def _second_thread() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, "enliven-scanning")


def run_in_pieces(kernel: Callable[..., Any], count: int, length: int, *arguments: Any) -> None:
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
    other = _second_thread().submit(work, pieces.pop)
    work(pieces.popleft)
    if not other.cancel():
        other.result()


def compute_ahead(items: Iterator[T]) -> Iterator[T]:
    """Yields the items; while the caller uses one, the second thread computes the next."""
    end = object()
    coming = _second_thread().submit(next, items, end)
    while (item := coming.result()) is not end:
        coming = _second_thread().submit(next, items, end)
        yield cast("T", item)


def run_in_two_threads(do: Callable[[T, S], None], items: Sequence[S], tool: Callable[[], T]) -> None:
    """Calls ``do(tool, item)`` for all items, in no defined order. Each of the two threads creates its own
    tool.

    ``do`` may call kernels through :func:`run_in_pieces`. The second thread is then busy, so each thread runs
    its kernels alone.
    """
    waiting = deque(items)

    def work() -> None:
        own_tool = tool()
        while True:
            try:
                item = waiting.popleft()
            except IndexError:
                return
            do(own_tool, item)

    other = _second_thread().submit(work)
    try:
        work()
    finally:
        waiting.clear()
        if not other.cancel():
            other.result()
