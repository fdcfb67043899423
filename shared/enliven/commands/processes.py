"""Runs several programs as one: starts, watches and ends them together, without orphan processes."""

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
"""Environment variable with the process id of the parent program. A child ends when its parent has ended."""

log = logging.getLogger(__name__)

_INITIAL_WAIT_S = 1.0
"""Wait before a program is restarted for the first time, in seconds. By then, its port and camera are free
again."""
_MAX_WAIT_S = 30.0
"""Maximum wait between two restarts, in seconds. The wait doubles after each restart, so that a program that
always fails costs little."""
_STABLE_RUN_S = 60.0
"""Running time, in seconds, after which a program counts as stable. The wait is then reset to its initial
value."""
_TERMINATION_GRACE_S = 8.0
"""Time in seconds from the termination signal to the kill of a child process. An edge closes its recording
and camera in that time."""
_POLL_INTERVAL_S = 0.05
"""Interval between two checks of the child processes, in seconds: short enough to react at once, and
cheap."""


@dataclass(frozen=True)
class Process:
    """One program of a run.

    Attributes:
        name: its name in messages.
        arguments: its arguments of the ``enliven`` command line.
        leads: True if the whole run ends when this program ends.
        again: the arguments for a restart after a failure, once all programs have started. If None, its
            failure ends the run.
        ready: returns True when the next program can be started.
    """

    name: str
    arguments: Sequence[str]
    leads: bool = False
    again: Sequence[str] | None = None
    ready: Callable[[], bool] | None = None


def run_together(processes: Sequence[Process]) -> int:
    """Runs the programs until the leading one ends, one fails without restart, or Ctrl-C. Returns the exit
    code."""
    with _end_together() as children:
        try:
            for process in processes:
                children.append(start_process(process.arguments))
                code = _wait_until_ready(process, children[-1])
                if code is not None:
                    return _exit_code_from_status(code)
            return _wait_for_exit(processes, children)
        except KeyboardInterrupt:
            return 130


def is_listening(host: str, port: int) -> bool:
    """Returns True if a program accepts connections at a port."""
    try:
        with socket.create_connection((host, port), timeout=0.2):
            return True
    except OSError:
        return False


def start_process(
    arguments: Sequence[str], stderr: IO[str] | None = None, stdout: IO[str] | None = None
) -> subprocess.Popen[bytes]:
    """Starts the ``enliven`` program with arguments, as a child process that ends with its parent.

    The child ignores Ctrl-C from its start, because Ctrl-C could end it in the middle of an import. The
    parent ends it instead.

    Args:
        stderr: a file for its messages. None uses the parent's standard error.
        stdout: a file for its output. None uses the parent's standard output.
    """
    environment = {**os.environ, PARENT_VARIABLE: str(os.getpid())}
    with _block_interrupts():
        command = [sys.executable, "-m", "enliven", *arguments]
        return subprocess.Popen(command, env=environment, stderr=stderr, stdout=stdout)


@contextlib.contextmanager
def _block_interrupts() -> Iterator[None]:
    """Blocks Ctrl-C (SIGINT) until the end of the block. A program started in the block inherits this
    (POSIX)."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _wait_until_ready(process: Process, child: subprocess.Popen[bytes]) -> int | None:
    """Waits until the program is ready, and returns None. If the program ends before, returns its exit
    code."""
    while process.ready is not None and not process.ready():
        if child.poll() is not None:
            return child.returncode
        time.sleep(_POLL_INTERVAL_S)
    return None


@dataclass
class _Restarts:
    """The restart times of one program.

    Attributes:
        started: time of its last start, in seconds of the monotonic clock.
        wait_s: wait in seconds between its next failure and the restart.
        due: time of its next start, in seconds of the monotonic clock. None while it runs.
    """

    started: float
    wait_s: float
    due: float | None = None

    def plan(self, name: str, code: int) -> None:
        """Plans the next start of a program that has ended, and logs it."""
        time_now = time.monotonic()
        if time_now - self.started > _STABLE_RUN_S:
            self.wait_s = _INITIAL_WAIT_S
        self.due = time_now + self.wait_s
        log.warning("the %s has ended %s. It starts again in %g s.", name, _exit_reason(code), self.wait_s)
        self.wait_s = min(2 * self.wait_s, _MAX_WAIT_S)


def _wait_for_exit(processes: Sequence[Process], children: list[subprocess.Popen[bytes]]) -> int:
    """Waits, and returns the exit code of the leading program, or of the first that fails without restart.

    A program with ``again`` that fails is restarted, with a growing wait between its starts.
    """
    restarts = [_Restarts(time.monotonic(), _INITIAL_WAIT_S) for _ in processes]
    while True:
        for number, process in enumerate(processes):
            code = children[number].poll()
            if code is None or (code == 0 and not process.leads):
                continue
            if process.leads or process.again is None:
                if code < 0:
                    log.warning("the %s has ended %s.", process.name, _exit_reason(code))
                return _exit_code_from_status(code)
            restart = restarts[number]
            if restart.due is None:
                restart.plan(process.name, code)
            elif time.monotonic() >= restart.due:
                children[number] = start_process(process.again)
                restart.started, restart.due = time.monotonic(), None
        time.sleep(_POLL_INTERVAL_S)


def _exit_reason(code: int) -> str:
    """Returns the reason for the end of a program, for a message: the signal or the exit code."""
    if code >= 0:
        return f"with exit code {code}"
    with contextlib.suppress(ValueError):
        return f"by the signal {signal.Signals(-code).name}"
    return f"by signal {-code}"


def parent_is_gone() -> bool:
    """Returns True if the program that started this one has ended. Always False on other systems than
    POSIX."""
    parent = os.environ.get(PARENT_VARIABLE)
    return (
        parent is not None
        and hasattr(os, "getppid")
        and sys.platform != "win32"
        and os.getppid() != int(parent)
    )


@contextlib.contextmanager
def _end_together() -> Iterator[list[subprocess.Popen[bytes]]]:
    """Yields a list for the child processes. At the end of the block, terminates every child, and kills those
    that do not end."""
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
    """Terminates the running children, waits, and kills those that remain. A second Ctrl-C does not interrupt
    this."""
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


def _exit_code_from_status(code: int) -> int:
    """Returns a child's exit status as an exit code: 130 if it was interrupted, 1 if it crashed."""
    if code in (-signal.SIGINT, -signal.SIGTERM):
        return 130
    return 1 if code < 0 else code
