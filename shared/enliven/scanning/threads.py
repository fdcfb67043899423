"""The second thread of a scan, which computes pieces of a kernel's range, or the next items."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, TypeVar, cast

from enliven import kernels

T = TypeVar("T")
S = TypeVar("S")


@cache
def _second_thread() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, "enliven-scanning")


def run_in_pieces(kernel: Callable[..., Any], count: int, length: int, *arguments: Any) -> None:
    """Calls ``kernel(*arguments, first, last)`` for pieces of ``length`` that cover 0 to ``count``."""
    kernels.run_in_pieces(kernel, count, length, _second_thread(), *arguments)


def compute_ahead(items: Iterator[T]) -> Iterator[T]:
    """Yields the items of an iterator. While the caller uses an item, the second thread computes the next
    one.
    """
    end = object()
    next_item = _second_thread().submit(next, items, end)
    while (item := next_item.result()) is not end:
        next_item = _second_thread().submit(next, items, end)
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

    second_thread = _second_thread().submit(work)
    try:
        work()
    finally:
        waiting.clear()
        if not second_thread.cancel():
            second_thread.result()
