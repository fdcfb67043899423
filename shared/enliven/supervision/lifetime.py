"""Starts child programs that end with their parent, and ends them."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import IO

PARENT_VARIABLE = "ENLIVEN_PARENT"
"""Environment variable with the process id of the parent program. A child process ends when its parent has
ended."""
_KERNEL_WATCHES_VARIABLE = "ENLIVEN_ENDS_WITH_PARENT"
"""Environment variable of a child process that the kernel must end together with its parent, see
:func:`end_with_parent`."""
TERMINATION_GRACE_S = 8.0
"""Time in seconds from the termination signal to the kill signal for a child process. An edge needs this time
to close its recording and its camera.
"""
_PR_SET_PDEATHSIG = 1
"""Linux's prctl operation that sets the signal at the end of the parent (linux/prctl.h)."""


def start_child(
    command: Sequence[str],
    environment: Mapping[str, str] | None = None,
    stderr: IO[str] | None = None,
    stdout: IO[str] | None = None,
    *,
    is_bound: bool = False,
) -> subprocess.Popen[bytes]:
    """Starts a program as a child process. An ``enliven`` program ends with its parent.

    The child ignores Ctrl-C from its start, because Ctrl-C could end it in the middle of an import. The
    parent ends it instead.

    Args:
        environment: environment variables in addition to those of this process.
        stderr: a file for its messages. None uses the parent's standard error.
        stdout: a file for its output. None uses the parent's standard output.
        is_bound: True makes the kernel terminate an ``enliven`` program when this *thread* ends, even if the
            program is frozen (Linux).

    Raises:
        OSError: if the program cannot be started.
    """
    variables = {**os.environ, **(environment or {}), PARENT_VARIABLE: str(os.getpid())}
    if is_bound:
        variables[_KERNEL_WATCHES_VARIABLE] = "1"
    with block_interrupts():
        return subprocess.Popen(list(command), env=variables, stderr=stderr, stdout=stdout)


@contextlib.contextmanager
def block_interrupts() -> Iterator[None]:
    """Blocks Ctrl-C (SIGINT) until the end of the ``with`` block. A program that is started in the block
    inherits the blocked signal (POSIX)."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    old_mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, old_mask)


def parent_is_gone() -> bool:
    """Returns True if the program that started this program has ended. Always returns False on systems other
    than POSIX."""
    parent = os.environ.get(PARENT_VARIABLE)
    return (
        parent is not None
        and hasattr(os, "getppid")
        and sys.platform != "win32"
        and os.getppid() != int(parent)
    )


def end_with_parent() -> None:
    """Makes the kernel terminate this process when its parent ends, if the parent requested this (Linux
    only).

    Unlike a main loop that calls :func:`parent_is_gone`, this also works while the process waits or is
    frozen.
    """
    if os.environ.pop(_KERNEL_WATCHES_VARIABLE, None) is None or sys.platform != "linux":
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if parent_is_gone():
        # The parent ended before the kernel could watch it.
        os.kill(os.getpid(), signal.SIGTERM)


def end_children(children: Sequence[subprocess.Popen[bytes]], grace_s: float) -> None:
    """Terminates the running children, waits for ``grace_s`` seconds, and kills those that remain."""
    for child in children:
        if child.poll() is None:
            child.terminate()
    deadline = time.monotonic() + grace_s
    for child in children:
        try:
            child.wait(max(0.1, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()


@contextlib.contextmanager
def terminate_as_interrupt() -> Iterator[None]:
    """Makes SIGTERM (from systemd or kill) end the program in the same way as Ctrl-C."""

    def interrupt(signum: int, frame: object) -> None:
        raise KeyboardInterrupt

    old_handler = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, old_handler)
