"""Several programs as one: started together, watched, and ended together with no orphan left."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import IO

PARENT_VARIABLE = "ENLIVEN_PARENT"
"""The process id of the program that started this one; a child ends when that program is gone."""

_GRACE = 8.0
"""Seconds that ended children have before they are killed: an edge closes its recording and camera in that
time."""
_GLANCE = 0.05
"""Seconds between two looks at the children: an end is noticed at once and the looking costs nothing."""


@dataclass(frozen=True)
class Process:
    """One program of the list.

    Attributes:
        name: what it is called in messages.
        arguments: of the ``enliven`` command line.
        leads: the whole run ends when this one does.
        ready: the next program of the list is started once this says so.
    """

    name: str
    arguments: Sequence[str]
    leads: bool = False
    ready: Callable[[], bool] | None = None


def run_together(processes: Sequence[Process]) -> int:
    """Runs the programs until the leading one ends, one fails, or Ctrl-C; returns the exit code."""
    with _ended_together() as children:
        try:
            for process in processes:
                children.append(start_process(process.arguments))
                code = _wait_until_ready(process, children[-1])
                if code is not None:
                    return _meaning(code)
            return _watch(processes, children)
        except KeyboardInterrupt:
            return 130


def is_listening(host: str, port: int) -> bool:
    """Whether something accepts connections there."""
    try:
        with socket.create_connection((host, port), timeout=0.2):
            return True
    except OSError:
        return False


def start_process(
    arguments: Sequence[str], stderr: IO[str] | None = None, stdout: IO[str] | None = None
) -> subprocess.Popen[bytes]:
    """Starts the ``enliven`` program with arguments, as a child that knows its parent's process id.

    It is born deaf to Ctrl-C, which would end it in the middle of an import: this program ends it.

    Args:
        stderr: a file for its messages; None: where this program's own go.
        stdout: a file for what it prints; None: where this program's own goes.
    """
    environment = {**os.environ, PARENT_VARIABLE: str(os.getpid())}
    with _interrupts_held():
        command = [sys.executable, "-m", "enliven", *arguments]
        return subprocess.Popen(command, env=environment, stderr=stderr, stdout=stdout)


@contextlib.contextmanager
def _interrupts_held() -> Iterator[None]:
    """Holds Ctrl-C back until the end of the block; a program started in it never gets one (POSIX)."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _wait_until_ready(process: Process, child: subprocess.Popen[bytes]) -> int | None:
    """Waits until the program is ready and returns None; returns its exit code where it ended before."""
    while process.ready is not None and not process.ready():
        if child.poll() is not None:
            return child.returncode
        time.sleep(_GLANCE)
    return None


def _watch(processes: Sequence[Process], children: Sequence[subprocess.Popen[bytes]]) -> int:
    """Waits and returns the exit code of the first program that fails, or of the leading one."""
    while True:
        for process, child in zip(processes, children, strict=True):
            code = child.poll()
            if code is not None and (process.leads or code != 0):
                return _meaning(code)
        time.sleep(_GLANCE)


def parent_is_gone() -> bool:
    """Returns whether the program that started this one has ended (POSIX; elsewhere always False)."""
    parent = os.environ.get(PARENT_VARIABLE)
    return (
        parent is not None
        and hasattr(os, "getppid")
        and sys.platform != "win32"
        and os.getppid() != int(parent)
    )


@contextlib.contextmanager
def _ended_together() -> Iterator[list[subprocess.Popen[bytes]]]:
    """Yields a list for the children; on leaving, every child is terminated, and killed where it does not
    end."""
    children: list[subprocess.Popen[bytes]] = []
    with terminate_as_interrupt():
        try:
            yield children
        finally:
            _end(children)


@contextlib.contextmanager
def terminate_as_interrupt() -> Iterator[None]:
    """Makes SIGTERM (systemd, kill) end the run as Ctrl-C does."""

    def interrupt(signum: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _end(children: Sequence[subprocess.Popen[bytes]]) -> None:
    """Terminates the children that still run, waits, and kills those that remain; a second Ctrl-C does not
    stop this."""
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    for child in children:
        if child.poll() is None:
            child.terminate()
    deadline = time.monotonic() + _GRACE
    for child in children:
        try:
            child.wait(max(0.1, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _meaning(code: int) -> int:
    """Returns a child's exit status as an exit code; a child that a signal ended counts as interrupted."""
    return 130 if code < 0 else code
