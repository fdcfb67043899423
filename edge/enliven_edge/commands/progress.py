"""What commands show on a terminal, frames as they are counted and facts, and what Ctrl-C does meanwhile."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterable, Iterator

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table


@contextlib.contextmanager
def at_signals(act: Callable[[], None], *signals: int) -> Iterator[None]:
    """Calls ``act`` at these signals; on another thread than the main one, which gets none, does nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {each: signal.signal(each, lambda *_: act()) for each in signals}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


@contextlib.contextmanager
def interruptible() -> Iterator[threading.Event]:
    """Yields an event that Ctrl-C sets, so that the work is completed; a second Ctrl-C interrupts at once."""
    stop = threading.Event()

    def interrupted() -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    with at_signals(interrupted, signal.SIGINT):
        yield stop


def frame_progress(console: Console) -> Progress:
    """Returns a bar with the share done, the frames and the time; tasks need the field ``count``."""
    return Progress(
        SpinnerColumn(),
        TextColumn("{task.description}: {task.fields[count]} frames"),
        TimeElapsedColumn(),
        console=console,
        transient=True,
    )


def facts_table(facts: Iterable[tuple[str, str]]) -> Table:
    """Returns facts, each with its name, as a table without lines."""
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for fact in facts:
        table.add_row(*fact)
    return table
