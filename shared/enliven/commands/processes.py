"""Several programs as one: started together, watched, and ended together with no orphan left."""

from __future__ import annotations

import contextlib
import logging
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

log = logging.getLogger(__name__)

_FIRST_WAIT_S = 1.0
"""Wait before a program is restarted for the first time, in seconds. By then, its port and camera are free
again."""
_MAX_WAIT_S = 30.0
"""Longest wait between two restarts, in seconds. The wait doubles after each restart, so that a program that
always fails costs little."""
_STEADY_S = 60.0
"""Running time, in seconds, after which a program counts as stable. The wait then begins at its first value
again."""
_TERMINATION_GRACE_S = 8.0
"""Time that ended child processes get before they are killed, in seconds. An edge closes its recording and
camera in that time."""
_POLL_INTERVAL_S = 0.05
"""Interval between two checks of the child processes, in seconds. An end is noticed at once, and the checks
cost nothing."""


@dataclass(frozen=True)
class Process:
    """One program of the list.

    Attributes:
        name: what it is called in messages.
        arguments: of the ``enliven`` command line.
        leads: the whole run ends when this one does.
        again: the arguments with which it is started again after a failure, once all have started; None: its
            failure ends the run.
        ready: the next program of the list is started once this says so.
    """

    name: str
    arguments: Sequence[str]
    leads: bool = False
    again: Sequence[str] | None = None
    ready: Callable[[], bool] | None = None


def run_together(processes: Sequence[Process]) -> int:
    """Runs the programs until the leading one ends, one fails for good, or Ctrl-C; returns the exit code."""
    with _ended_together() as children:
        try:
            for process in processes:
                children.append(start_process(process.arguments))
                code = _wait_until_ready(process, children[-1])
                if code is not None:
                    return _exit_code_of(code)
            return _wait_for_exit(processes, children)
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
        time.sleep(_POLL_INTERVAL_S)
    return None


@dataclass
class _Restarts:
    """When one program is started again.

    Attributes:
        started: the monotonic second of its last start.
        wait_s: seconds from its next end to its next start.
        due: the monotonic second of its next start; None while it runs.
    """

    started: float
    wait_s: float
    due: float | None = None

    def plan(self, name: str, code: int) -> None:
        """Plans the next start of a program that has ended, and says so."""
        now = time.monotonic()
        if now - self.started > _STEADY_S:
            self.wait_s = _FIRST_WAIT_S
        self.due = now + self.wait_s
        log.warning("the %s has ended %s. It starts again in %g s.", name, _exit_reason(code), self.wait_s)
        self.wait_s = min(2 * self.wait_s, _MAX_WAIT_S)


def _wait_for_exit(processes: Sequence[Process], children: list[subprocess.Popen[bytes]]) -> int:
    """Waits and returns the exit code of the leading program, or of the first that fails for good.

    A program with ``again`` that fails is started again, with a growing wait between its starts.
    """
    restarts = [_Restarts(time.monotonic(), _FIRST_WAIT_S) for _ in processes]
    while True:
        for number, process in enumerate(processes):
            code = children[number].poll()
            if code is None or (code == 0 and not process.leads):
                continue
            if process.leads or process.again is None:
                if code < 0:
                    log.warning("the %s has ended %s.", process.name, _exit_reason(code))
                return _exit_code_of(code)
            restart = restarts[number]
            if restart.due is None:
                restart.plan(process.name, code)
            elif time.monotonic() >= restart.due:
                children[number] = start_process(process.again)
                restart.started, restart.due = time.monotonic(), None
        time.sleep(_POLL_INTERVAL_S)


def _exit_reason(code: int) -> str:
    """Returns how a program ended, for a sentence: by which signal, or with which exit code."""
    if code >= 0:
        return f"with exit code {code}"
    with contextlib.suppress(ValueError):
        return f"by the signal {signal.Signals(-code).name}"
    return f"by signal {-code}"


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
            _end_children(children)


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


def _end_children(children: Sequence[subprocess.Popen[bytes]]) -> None:
    """Terminates the children that still run, waits, and kills those that remain; a second Ctrl-C does not
    stop this."""
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    for child in children:
        if child.poll() is None:
            child.terminate()
    deadline = time.monotonic() + _TERMINATION_GRACE_S
    for child in children:
        try:
            child.wait(max(0.1, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _exit_code_of(code: int) -> int:
    """Returns a child's exit status as an exit code: 130 if it was interrupted, 1 if it crashed."""
    if code in (-signal.SIGINT, -signal.SIGTERM):
        return 130
    return 1 if code < 0 else code
