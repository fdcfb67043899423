"""A test's bounds: what takes more memory or more time than these fails, and takes nothing down with it."""

from __future__ import annotations

import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class TooSlow(BaseException):
    """No Exception, so that no reader takes it for damage."""


@contextmanager
def bounded(megabytes: int = 512, seconds: float = 60) -> Iterator[None]:
    """Limits the additional memory of the process, and the time of the main thread.

    A MemoryError is raised if more memory is requested, and :class:`TooSlow` when the time is over, even if
    the code under test swallowed it.
    """
    fired = []

    def stop(*_: Any) -> None:
        fired.append(True)
        raise TooSlow(f"longer than {seconds:g} s")

    before = signal.signal(signal.SIGALRM, stop)
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (_data_bytes() + megabytes * 2**20, hard))
    # Again and again: a library may swallow the first, and wait for the next pipe.
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
    """Bytes of private memory that the process has now, as RLIMIT_DATA counts them."""
    with open("/proc/self/status", encoding="ascii") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmData:")) * 1024
