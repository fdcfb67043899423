"""The programs of a soak, which run under enliven's supervisor, are killed by the soak, and are measured."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from enliven.commands.processes import enliven_command
from enliven.supervision import child
from enliven.supervision.lifetime import TERMINATION_GRACE_S
from enliven.supervision.records import read_restarts, read_services
from enliven.supervision.supervisor import RecordFolders, Supervisor

MAX_ERRORS = 200
"""Maximum number of kept error lines of a program."""
KILL_CAUSE = "signal SIGKILL"
"""Cause in the supervisor's records if the soak killed a program."""
FROZEN_CAUSE = "no progress"
"""Beginning of the cause in the supervisor's records if a program was frozen."""
_SHELL = 'log="$1"; shift; exec "$@" >>"$log" 2>&1'
"""Shell command that replaces itself by a program, and sends its output to a file."""
_MAX_END_S = 3.0 * TERMINATION_GRACE_S
"""Timeout for the supervisor at the end, seconds. It kills programs after a third of this time."""


@dataclass
class Sample:
    """One measurement of a program.

    Attributes:
        at_s: seconds after the start of the soak.
        life: number of the program's process since the start of the soak, from 1.
        rss_mb: resident memory, MB.
        handles: open file descriptors.
        threads: number of threads.
        frames: number of frames that the edge has published since the start of the soak.
    """

    at_s: float
    life: int
    rss_mb: float
    handles: int
    threads: int
    frames: int


@dataclass
class Program:
    """One program, which the supervisor restarts whenever it ends.

    Attributes:
        name: its name in the report.
        arguments: arguments of its ``enliven`` command line.
        service: its name for the supervisor. An edge also writes records with this name.
        frozen_after_s: seconds without progress until it is restarted, None if it reports no progress.
        ready: returns True when the next program can be started, None to start it at once.
        expected_freezes: number of times that the soak has frozen it.
        samples: its measurements.
        restarts: (Unix time in seconds, cause) of each restart, from the supervisor's records.
        errors: lines of its log with the level error, and lines of tracebacks.
    """

    name: str
    arguments: Sequence[str]
    service: str
    frozen_after_s: float | None = None
    ready: Callable[[], bool] | None = None
    expected_freezes: int = 0
    samples: list[Sample] = field(default_factory=list)
    restarts: list[tuple[float, str]] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    _pid: int = 0
    _life: int = 0
    _kills: int = 0
    _is_kill_due: bool = False
    _read_to: int = 0

    @property
    def pid(self) -> int:
        """Returns the process id of the newest process, 0 if it has not started."""
        return self._pid

    def kill(self) -> None:
        """Kills the process like a power failure. If it does not run, its next process is killed."""
        self._is_kill_due = True

    def take_pid(self, pid: int) -> None:
        """Stores the process id that the supervisor has recorded. Kills the process if a kill is pending."""
        if pid and pid != self._pid:
            self._life += 1
            self._pid = pid
        if self._is_kill_due and pid:
            # The record of a process that has just ended is renewed within two seconds.
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
                self._is_kill_due = False
                self._kills += 1

    def sample(self, at_s: float, frames: int) -> None:
        """Measures the process if it runs. ``frames`` is the number of published frames."""
        proc = Path(f"/proc/{self._pid}")
        try:
            status = (proc / "status").read_text()
            rss = int(status.split("VmRSS:")[1].split()[0]) / 1024
            threads = int(status.split("Threads:")[1].split()[0])
            handles = len(list((proc / "fd").iterdir()))
        except (OSError, IndexError):
            return
        self.samples.append(Sample(at_s, self._life, rss, handles, threads, frames))

    @property
    def unexpected_ends(self) -> list[str]:
        """Returns the causes of the restarts that the soak did not cause."""
        expected = {KILL_CAUSE: self._kills, FROZEN_CAUSE: self.expected_freezes}
        unexpected = []
        for _, cause in self.restarts:
            kind = next((each for each in expected if cause.startswith(each)), "")
            if expected.get(kind, 0) > 0:
                expected[kind] -= 1
            else:
                unexpected.append(cause)
        return unexpected

    def log_path(self, folder: Path) -> Path:
        """Returns the log file that contains the output of all its processes."""
        return folder / f"{self.name.replace(' ', '-')}.log"

    def read_log(self, folder: Path) -> None:
        """Stores the errors among the new lines of the log."""
        with contextlib.suppress(FileNotFoundError), self.log_path(folder).open("rb") as file:
            file.seek(self._read_to)
            data = file.read()
            whole = data[: data.rfind(b"\n") + 1]
            self._read_to += len(whole)
            for line in whole.decode(errors="replace").splitlines():
                if is_error(line) and len(self.errors) < MAX_ERRORS:
                    self.errors.append(f"{self.name} {self._life}: {line[:2000]}")


class ProgramGroup:
    """Programs under one supervisor, in the order of their start.

    The supervisor runs in a thread of the soak. Like the health page, the soak reads processes and restarts
    from the supervisor's records.

    Args:
        programs: the programs.
        folder: folder of the logs and records.
    """

    def __init__(self, programs: Sequence[Program], folder: Path) -> None:
        self.programs, self._folder = programs, folder
        self.folders = RecordFolders(folder / "runtime", folder / "history")
        self._supervisor = Supervisor([self._supervised(each) for each in programs], self.folders)
        self._thread = threading.Thread(target=self._supervisor.run, name="supervisor", daemon=True)

    def start(self) -> None:
        """Starts the supervisor, which starts the programs."""
        self._thread.start()

    @property
    def is_over(self) -> bool:
        """Returns True if the supervisor has ended, because a program ended before the next one was
        started.
        """
        return not self._thread.is_alive()

    def poll(self) -> None:
        """Reads the records and the logs."""
        pids = {record.name: record.pid for record in read_services(self.folders.runtime)}
        restarts = read_restarts(self.folders.history)
        for program in self.programs:
            program.restarts = [(each.at_s, each.cause) for each in restarts if each.name == program.service]
            program.take_pid(pids.get(program.service, 0))
            program.read_log(self._folder)

    def end(self) -> Mapping[str, int]:
        """Ends all programs by SIGTERM. Returns the exit status of each running process by name.

        Raises:
            SystemExit: if the supervisor does not end.
        """
        self._supervisor.stop()
        self._thread.join(_MAX_END_S)
        if self._thread.is_alive():
            raise SystemExit(f"soak: the supervisor did not end within {_MAX_END_S:g} s")
        for program in self.programs:
            program.read_log(self._folder)
        names = {program.service: program.name for program in self.programs}
        return {names[service]: code for service, code in self._supervisor.exit_codes.items()}

    def _supervised(self, program: Program) -> child.Program:
        """Returns a program's description for the supervisor."""
        command = enliven_command([*program.arguments, "--log-json"])
        return child.Program(
            program.service,
            ["/bin/sh", "-c", _SHELL, "sh", str(program.log_path(self._folder)), *command],
            frozen_after_s=program.frozen_after_s,
            ready=program.ready,
            environment={"PYTHONFAULTHANDLER": "1"},
        )


def is_error(line: str) -> bool:
    """Returns True for a line of the level error, and for the start of a traceback."""
    try:
        record = json.loads(line)
    except ValueError:
        return line.startswith(("Traceback", "Fatal Python error"))
    return isinstance(record, dict) and record.get("level") in ("error", "critical")
