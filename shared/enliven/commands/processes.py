"""Several programs as one: started together, watched, and ended together with no orphan left."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

PARENT_VARIABLE = "ENLIVEN_PARENT"
"""The process id of the program that started this one; a child ends when that program is gone."""

_GRACE = 8.0


@dataclass(frozen=True)
class Process:
    """One program of the list.

    Attributes:
        name: what it is called in messages.
        arguments: of the ``enliven`` command line.
        leads: the whole run ends when this one does.
    """

    name: str
    arguments: Sequence[str]
    leads: bool = False


def run_together(processes: Sequence[Process]) -> int:
    """Runs the programs until the leading one ends, one fails, or Ctrl-C; returns the exit code.

    Interrupts are left to the children, which the terminal sends them too, and this waits for them.
    """
    with _started(processes) as children:
        try:
            while True:
                for process, child in zip(processes, children, strict=True):
                    code = child.poll()
                    if code is not None and (process.leads or code != 0):
                        return _meaning(code)
                time.sleep(0.05)
        except KeyboardInterrupt:
            return 130


def parent_is_gone() -> bool:
    """Whether this program was started by another that no longer lives (POSIX; elsewhere never)."""
    parent = os.environ.get(PARENT_VARIABLE)
    return (
        parent is not None
        and hasattr(os, "getppid")
        and sys.platform != "win32"
        and os.getppid() != int(parent)
    )


@contextlib.contextmanager
def _started(processes: Sequence[Process]) -> Iterator[list[subprocess.Popen[bytes]]]:
    """The running children; on the way out every one is ended, politely first."""
    children: list[subprocess.Popen[bytes]] = []
    environment = {**os.environ, PARENT_VARIABLE: str(os.getpid())}
    with _terminate_as_interrupt():
        try:
            for process in processes:
                command = [sys.executable, "-m", "enliven", *process.arguments]
                children.append(subprocess.Popen(command, env=environment))
            yield children
        finally:
            _end(children)


@contextlib.contextmanager
def _terminate_as_interrupt() -> Iterator[None]:
    """SIGTERM (systemd, kill) ends the run as Ctrl-C does."""

    def interrupt(signum: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _end(children: Sequence[subprocess.Popen[bytes]]) -> None:
    """Terminates what still runs, waits, and kills what does not heed; a second Ctrl-C does not stop this."""
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
    """A child's exit status as one of ours: ended by a signal is interrupted."""
    return 130 if code < 0 else code
