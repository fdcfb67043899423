"""Uses a second thread in a scan: it computes the next items of an iterator, or processes half of the
items."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar, cast

from enliven.kernels import second_thread

T = TypeVar("T")
S = TypeVar("S")


def compute_ahead(items: Iterator[T]) -> Iterator[T]:
    """Yields the items of an iterator. While the caller uses an item, the second thread computes the next
    one.
    """
    end = object()
    next_item = second_thread().submit(next, items, end)
    while (item := next_item.result()) is not end:
        next_item = second_thread().submit(next, items, end)
        yield cast("T", item)


def run_in_two_threads(do: Callable[[T, S], None], items: Sequence[S], tool: Callable[[], T]) -> None:
    """Calls ``do(tool, item)`` for all items, in no defined order. Each of the two threads creates its own
    tool.

    ``do`` may call kernels through :func:`enliven.kernels.run_in_pieces`. The second thread is then busy, so
    each thread runs its kernels alone.
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

    rest = second_thread().submit(work)
    try:
        work()
    finally:
        waiting.clear()
        if not rest.cancel():
            rest.result()
