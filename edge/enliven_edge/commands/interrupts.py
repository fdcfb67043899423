"""What Ctrl-C and SIGTERM do while a command works."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator


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
