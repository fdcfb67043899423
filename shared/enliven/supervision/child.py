"""One supervised program: its process, its reports of progress, and its restarts."""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from .causes import OUT_OF_MEMORY_CAUSE, count_memory_kills, describe_exit
from .lifetime import start_child
from .notify import MAX_NOTIFICATION_BYTES, SOCKET_VARIABLE, WATCHDOG_VARIABLE, read_notification
from .records import ServiceRecord
from .schedule import RestartBackoff

log = logging.getLogger(__name__)

START_TIMEOUT_S = 900.0
"""Default timeout in seconds from the start of a program to its first report. At the first start on a small
machine, compiling the kernels of an edge takes more than 600 s."""
FROZEN_GRACE_S = 2.0
"""Time in seconds from the termination signal to the kill signal for a frozen program. It is short, because
few frozen programs react to the signal, and visitors are waiting.
"""
_MAX_NOTIFICATIONS = 1000
"""Maximum number of notifications that are read at once, so that a program that floods its socket does not
block the others.
"""
_SIGKILL_CODE = -9
"""Exit status of a process that was killed by the kernel or by an operator."""


@dataclass(frozen=True)
class Program:
    """A program to be supervised.

    Attributes:
        name: name of the program for operators, such as "edge floor".
        command: its command line. The first word is the program.
        restart: when it is restarted after it has ended: never, after a failure, or always.
        restart_command: its command line for restarts. None uses ``command``.
        leads: True if all programs end when this program ends and is not restarted.
        frozen_after_s: maximum time in seconds without a progress report. Then the program is restarted. None
            disables the check.
        start_timeout_s: maximum time in seconds from its start to its first report. It is ignored if
            ``frozen_after_s`` is None.
        ready: a function that returns True when the next program can be started. If None, the next program is
            started immediately.
        environment: environment variables in addition to those of the supervisor.
    """

    name: str
    command: Sequence[str]
    restart: Literal["never", "failure", "always"] = "always"
    restart_command: Sequence[str] | None = None
    leads: bool = False
    frozen_after_s: float | None = None
    start_timeout_s: float = START_TIMEOUT_S
    ready: Callable[[], bool] | None = None
    environment: Mapping[str, str] = field(default_factory=dict)

    def is_ready(self) -> bool:
        """Returns True if the next program can be started."""
        return self.ready is None or self.ready()


class SupervisedProcess:
    """The process of a supervised program. Times are in seconds of the monotonic clock, unless stated
    otherwise.

    Args:
        program: the program.
        socket_path: path of the socket for its reports. It must be short.
        backoff: computes the delays between its restarts.
    """

    def __init__(self, program: Program, socket_path: Path, backoff: RestartBackoff | None = None) -> None:
        self.program = program
        self.process: subprocess.Popen[bytes] | None = None
        self.due_s: float | None = 0.0
        self.exit_code: int | None = None
        self._backoff = backoff or RestartBackoff()
        self._started_before = False
        self._started_s = self._progress_s = self._deadline_s = 0.0
        self._is_ready, self._status = False, ""
        self._end_reason, self._kill_at_s = "", 0.0
        self._memory_kills = 0
        self._socket, self._address = _bind_socket(socket_path)

    @property
    def socket(self) -> socket.socket | None:
        """The socket for its reports, or None if this system does not support it."""
        return self._socket

    @property
    def _is_watched(self) -> bool:
        """True if the program must and can report progress."""
        return self.program.frozen_after_s is not None and self._socket is not None

    @property
    def is_ready(self) -> bool:
        """True if the running process has reported that it is ready."""
        return self._is_ready and self.process is not None

    @property
    def is_over(self) -> bool:
        """True if the program has ended and is not restarted."""
        return self.process is None and self.due_s is None

    def start(self, now_s: float) -> None:
        """Starts the program. A failed start is handled like an end with exit code 127, as in a shell."""
        program = self.program
        restart_command = program.restart_command if self._started_before else None
        environment = dict(program.environment)
        if self._address:
            environment[SOCKET_VARIABLE] = self._address
        if program.frozen_after_s is not None:
            environment[WATCHDOG_VARIABLE] = str(round(program.frozen_after_s * 1e6))
        self._drop_notifications()
        self._is_ready, self._status, self._end_reason = False, "", ""
        self._started_s, self._progress_s = now_s, 0.0
        self._deadline_s = now_s + program.start_timeout_s
        self._memory_kills = count_memory_kills()
        self._started_before, self.due_s, self.exit_code = True, None, None
        self.process = start_child(restart_command or program.command, environment, is_bound=True)

    def terminate(self, reason: str, now_s: float, grace_s: float) -> None:
        """Terminates the program, so that it is restarted. Kills it if it still runs after ``grace_s``
        seconds.
        """
        if self.process is None or self._end_reason:
            return
        self._end_reason, self._kill_at_s = reason, now_s + grace_s
        self.process.terminate()

    def check_process(self, now_s: float) -> str | None:
        """Reads reports, watches the progress, and kills a process that does not end.

        Returns:
            The cause of the end if the process has ended since the last call, otherwise None.
        """
        if self.process is None:
            return None
        self._read_notifications(now_s)
        code = self.process.poll()
        if code is not None:
            self.process, self.exit_code = None, code
            return self._end_reason or self._find_exit_cause(code)
        if self._end_reason:
            if now_s >= self._kill_at_s:
                self.process.kill()
        elif self._is_watched and now_s >= self._deadline_s:
            self.terminate(self._find_silence_reason(), now_s, FROZEN_GRACE_S)
        return None

    def plan_restart(self, now_s: float, *, is_failure: bool = True) -> float:
        """Schedules the next start of the program, and returns the delay in seconds.

        Args:
            is_failure: False for a planned restart, which is immediate.
        """
        wait_s = self._backoff.wait_after(now_s - self._started_s) if is_failure else 0.0
        self.due_s = now_s + wait_s
        return wait_s

    def create_record(self, now_s: float, unix_s: float) -> ServiceRecord:
        """Returns the state of the program.

        Args:
            unix_s: current Unix time in seconds.
        """
        if self.process is None:
            wait_s = max(0.0, (self.due_s or now_s) - now_s)
            return ServiceRecord(self.program.name, 0, 0.0, 0.0, f"ended, starts again in {wait_s:.0f} s")
        progress_s = unix_s - (now_s - self._progress_s) if self._progress_s else 0.0
        rss_mb = _read_resident_mb(self.process.pid)
        figures = {} if rss_mb is None else {"rss_mb": round(rss_mb, 1)}
        started_s = unix_s - (now_s - self._started_s)
        return ServiceRecord(
            self.program.name, self.process.pid, started_s, progress_s, self._status, figures
        )

    def close(self) -> None:
        """Closes the socket for reports."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _read_notifications(self, now_s: float) -> None:
        """Reads the program's notifications. A progress report postpones the time at which the program counts
        as frozen.
        """
        for _ in range(_MAX_NOTIFICATIONS):
            data = self._receive_report()
            if data is None:
                return
            fields = read_notification(data)
            self._status = fields.get("STATUS", self._status)
            if not self._is_ready and (extension := fields.get("EXTEND_TIMEOUT_USEC", "")).isdecimal():
                self._deadline_s = max(self._deadline_s, now_s + int(extension) * 1e-6)
            is_ready = fields.get("READY") == "1"
            if is_ready or (self._is_ready and fields.get("WATCHDOG") == "1"):
                self._is_ready, self._progress_s = True, now_s
                self._deadline_s = now_s + (self.program.frozen_after_s or 0.0)

    def _receive_report(self) -> bytes | None:
        """Returns one report, or None if there is none."""
        if self._socket is None:
            return None
        with contextlib.suppress(OSError):
            return self._socket.recv(MAX_NOTIFICATION_BYTES)
        return None

    def _drop_notifications(self) -> None:
        """Removes the notifications of the previous process, which must not count for the next process."""
        for _ in range(_MAX_NOTIFICATIONS):
            if self._receive_report() is None:
                return

    def _find_silence_reason(self) -> str:
        """Returns the reason for ending a program that does not report progress."""
        if self._is_ready:
            return f"no progress for {self.program.frozen_after_s:g} s"
        return f"not ready after {self._deadline_s - self._started_s:.0f} s"

    def _find_exit_cause(self, code: int) -> str:
        """Returns the reason why the process ended without being ended by the supervisor."""
        if code == _SIGKILL_CODE and count_memory_kills() > self._memory_kills:
            return OUT_OF_MEMORY_CAUSE
        return describe_exit(code)


def _bind_socket(path: Path) -> tuple[socket.socket | None, str]:
    """Returns a socket for reports and its address, or None and "" if this system has no such sockets."""
    if not hasattr(socket, "AF_UNIX") or sys.platform == "win32":
        return None, ""
    endpoint = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    endpoint.setblocking(False)
    try:
        endpoint.bind(str(path))
    except OSError as error:
        # The path of a temporary folder may be longer than the 100 bytes that such a socket allows.
        log.warning(
            "frozen programs cannot be detected and restarted, only programs that end (%s: %s)", path, error
        )
        endpoint.close()
        return None, ""
    return endpoint, str(path)


def _read_resident_mb(pid: int) -> float | None:
    """Returns the resident memory of a process in megabytes. Returns None if it is unknown, as always on
    systems other than Linux.
    """
    with contextlib.suppress(OSError, ValueError, IndexError):
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") * 1e-6
    return None
