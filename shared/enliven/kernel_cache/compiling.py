"""Reports the compilation of kernels, and delays garbage collection during compilation."""

from __future__ import annotations

import contextlib
import gc
import logging
import time
from collections.abc import Callable, Iterator

from numba.core import event

log = logging.getLogger(__name__)
_MAX_UNEXPLAINED_S = 5.0
"""Duration of compilation in seconds after which a log message explains the delay. Compiling a few kernels
takes less time.
"""
_EVENT = "numba:compile"
"""Name of Numba's event for the compilation of one function. Functions that it calls are compiled within this
event."""


class CompilationCounter(event.Listener):
    """A listener that counts the compiled functions of this process. Numba compiles in one thread at a time,
    under a lock.

    Compilation creates many objects that live until its end. Garbage collection would take a tenth of the
    time and free nothing. So it is delayed until the outermost function is compiled. This needs at most 80 MB
    more memory.
    """

    def __init__(self) -> None:
        self.callbacks: list[Callable[[int], None]] = []
        self._finished = 0
        self._depth = 0
        self._collects = False
        self._seconds = 0.0
        self._started = 0.0
        self._has_explained = False

    def on_start(self, event: object) -> None:
        """Disables garbage collection when the compilation of the outermost function starts, and reports the
        current count.
        """
        if self._depth == 0:
            self._log_compilation()
            self._started = time.perf_counter()
            self._collects = gc.isenabled()
            gc.disable()
        self._depth += 1
        for callback in self.callbacks:
            callback(self._finished)

    def on_end(self, event: object) -> None:
        """Enables garbage collection when the outermost function is finished, if it was enabled before."""
        self._finished += 1
        self._depth -= 1
        if self._depth > 0:
            return
        self._seconds += time.perf_counter() - self._started
        if self._collects:
            gc.enable()

    def _log_compilation(self) -> None:
        """Logs once that kernels are being compiled, unless a caller shows the progress itself."""
        if self._seconds > _MAX_UNEXPLAINED_S and not self._has_explained and not self.callbacks:
            self._has_explained = True
            log.info(
                "compiling kernels; this takes one or two minutes, and happens only once on this computer"
            )


_compilations = CompilationCounter()


def listen_to_compiler() -> None:
    """Counts compilations and delays garbage collection during them, for the rest of the process."""
    event.register(_EVENT, _compilations)


@contextlib.contextmanager
def watch_compilation(callback: Callable[[int], None]) -> Iterator[None]:
    """Calls a function whenever this process starts to compile a function.

    Args:
        callback: a function that is called with the number of functions that this process has compiled. It
            runs in the compiling thread, so it must be fast.
    """
    _compilations.callbacks.append(callback)
    try:
        yield
    finally:
        _compilations.callbacks.remove(callback)
