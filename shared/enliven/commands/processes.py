"""Runs several ``enliven`` programs together: starts, monitors and ends them."""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING

from enliven.supervision.lifetime import parent_is_gone, start_child, terminate_as_interrupt

if TYPE_CHECKING:
    from enliven.supervision.child import Program

__all__ = [
    "Process",
    "enliven_command",
    "is_listening",
    "parent_is_gone",
    "run_together",
    "start_process",
    "terminate_as_interrupt",
]


@dataclass(frozen=True)
class Process:
    """One program of a run.

    Attributes:
        name: the program's name in messages.
        arguments: the arguments of the ``enliven`` command line that starts it.
        leads: True if all programs end when this program ends.
        restart_arguments: the arguments for a restart if the program fails after it was ready. If None, its
            failure ends all programs.
        ready: a function that returns True when the next program can be started.
    """

    name: str
    arguments: Sequence[str]
    leads: bool = False
    restart_arguments: Sequence[str] | None = None
    ready: Callable[[], bool] | None = None


def run_together(processes: Sequence[Process]) -> int:
    """Runs the programs until the leading program ends, a program fails and cannot be restarted, or Ctrl-C is
    pressed. Returns the exit code.
    """
    from enliven.supervision.supervisor import (
        Supervisor,  # Imported here, so that the list of commands is fast.
    )

    return Supervisor([_make_supervised_program(process) for process in processes]).run()


def _make_supervised_program(process: Process) -> Program:
    """Converts a process to a program for the supervisor."""
    from enliven.supervision.child import Program

    return Program(
        process.name,
        enliven_command(process.arguments),
        restart="never" if process.leads or process.restart_arguments is None else "failure",
        restart_command=None
        if process.restart_arguments is None
        else enliven_command(process.restart_arguments),
        leads=process.leads,
        ready=process.ready,
    )


def enliven_command(arguments: Sequence[str]) -> list[str]:
    """Returns the command line that starts the ``enliven`` program of this installation."""
    return [sys.executable, "-m", "enliven", *arguments]


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

    Args:
        stderr: a file for its messages. None uses the parent's standard error.
        stdout: a file for its output. None uses the parent's standard output.
    """
    return start_child(enliven_command(arguments), stderr=stderr, stdout=stdout)
