"""Limits memory and time of a block of test code. Exceeding a limit fails the test without crashing the
process.
"""

from __future__ import annotations

import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class TooSlow(BaseException):
    """Raised at a timeout. It is no ``Exception``, so that file readers do not handle it as a damaged
    file.
    """


@contextmanager
def bounded(megabytes: int = 512, seconds: float = 60) -> Iterator[None]:
    """Limits the additional memory of the process, and the time of the main thread.

    A MemoryError is raised if more memory is requested. :class:`TooSlow` is raised after the timeout, even if
    the code under test has caught it before.
    """
    fired = []

    def stop(*_: Any) -> None:
        fired.append(True)
        raise TooSlow(f"longer than {seconds:g} s")

    before = signal.signal(signal.SIGALRM, stop)
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (_data_bytes() + megabytes * 2**20, hard))
    # The timer repeats because a library may catch the first exception and continue to wait.
    signal.setitimer(signal.ITIMER_REAL, seconds, 1.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
    if fired:
        raise TooSlow(f"longer than {seconds:g} s")


def _data_bytes() -> int:
    """Returns the bytes of private memory of the process, as RLIMIT_DATA counts them."""
    with open("/proc/self/status", encoding="ascii") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmData:")) * 1024
