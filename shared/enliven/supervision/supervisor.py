"""Supervises programs that run for weeks. Restarts a program that ends or does not make progress."""

from __future__ import annotations

import contextlib
import logging
import os
import selectors
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from enliven.errors import EnlivenError
from enliven.files import TemporaryFolder

from .causes import INTERRUPTED_EXIT_CODE, exit_code_from_status
from .child import Program, SupervisedProcess
from .lifetime import TERMINATION_GRACE_S, end_children
from .records import RestartRecord, ServiceRecord, append_restart, read_services, write_service
from .schedule import NightlyRestart, RestartBackoff

log = logging.getLogger(__name__)

NIGHTLY_CAUSE = "nightly restart"
"""Cause in the record of a nightly restart."""
POLL_INTERVAL_S = 0.05
"""Interval between two checks of the programs, in seconds. On Linux, the end of a program is detected
immediately."""
_RECORD_INTERVAL_S = 2.0
"""Interval in seconds at which the programs' states are recorded. The health page displays whole seconds."""
_FAILED_START_CODE = 127
"""Exit code of a program that could not be started, by the convention of shells."""


@dataclass(frozen=True)
class RecordFolders:
    """The folders for a supervisor's records.

    Attributes:
        runtime: folder of the programs' states.
        history: folder of the history of restarts. None uses the user's data folder.
    """

    runtime: Path
    history: Path | None = None


class Supervisor:
    """Starts programs as child processes and keeps them running.

    It restarts a program that ends or does not report progress. The first restart is immediate. Then the
    delay doubles up to 30 s. The number of restarts is unlimited. If the supervisor is killed, ``enliven``
    programs end, too.

    Args:
        programs: the programs, in the order of their start.
        folders: folders for records. If None, no records are written.
        restart_at: local time of a nightly restart of all programs, such as "04:00". Empty disables it.
        backoff: a function that creates the object with the restart delays of one program.

    Attributes:
        exit_codes: after :meth:`run`, the exit status of each process that it ended, by name of the program.
            A negative value is the number of a signal.

    Raises:
        InputError: if ``restart_at`` is not a time of day.
    """

    def __init__(
        self,
        programs: Sequence[Program],
        folders: RecordFolders | None = None,
        restart_at: str = "",
        backoff: Callable[[], RestartBackoff] = RestartBackoff,
    ) -> None:
        self._programs, self._folders, self._backoff = programs, folders, backoff
        self._nightly = NightlyRestart(restart_at, time.monotonic())
        self.exit_codes: dict[str, int] = {}
        self._children: list[SupervisedProcess] = []
        self._selector = selectors.DefaultSelector()
        self._end_descriptors: dict[SupervisedProcess, int] = {}
        self._is_stopped = False
        self._exit_code: int | None = None
        self._starting: SupervisedProcess | None = None
        self._recorded_s = -_RECORD_INTERVAL_S
        self._unwritable: set[str] = set()
        self._records: dict[str, ServiceRecord] = {}

    def stop(self) -> None:
        """Ends :meth:`run` soon. Safe to call from a signal handler or another thread."""
        self._is_stopped = True

    def run(self) -> int:
        """Supervises the programs, and ends all of them before it returns.

        Returns:
            The exit code of the leading program, or of the first program that fails and is not restarted. 130
            after SIGTERM, Ctrl-C or :meth:`stop`.
        """
        with TemporaryFolder("supervisor") as folder, self._handle_signals(), self._selector:
            self._children = [
                SupervisedProcess(program, Path(folder) / str(number), self._backoff())
                for number, program in enumerate(self._programs)
            ]
            try:
                return self._supervise()
            finally:
                self._end_all()

    def _supervise(self) -> int:
        """Runs until a program or a signal ends the run. Returns its exit code."""
        started_count = 0
        for child in self._children:
            if child.socket is not None:
                self._selector.register(child.socket, selectors.EVENT_READ)
        while self._exit_code is None and not self._is_stopped:
            started_count = self._start_next(started_count)
            for child in self._children[:started_count]:
                self._restart_if_ended(child)
            self._restart_if_night()
            self._write_records()
            if self._selector.get_map():
                self._selector.select(POLL_INTERVAL_S)
            else:
                time.sleep(POLL_INTERVAL_S)
        return INTERRUPTED_EXIT_CODE if self._exit_code is None else self._exit_code

    def _start_next(self, started_count: int) -> int:
        """Starts the next programs if the previous ones are ready. Returns the number of started programs."""
        while started_count < len(self._children):
            if self._starting is not None and not self._starting.program.is_ready():
                return started_count
            child = self._children[started_count]
            self._starting = None if child.program.ready is None else child
            started_count += 1
            self._start_program(child)
        if self._starting is not None and self._starting.program.is_ready():
            self._starting = None
        return started_count

    def _restart_if_ended(self, child: SupervisedProcess) -> None:
        """Restarts a program if it has ended."""
        now_s, was_ready = time.monotonic(), child.is_ready
        cause = child.check_process(now_s)
        if child.is_ready != was_ready:
            # Write the records immediately, so that the health page shows the change.
            self._recorded_s = -_RECORD_INTERVAL_S
        if cause is not None:
            self._close_end_descriptor(child)
            self._handle_end(child, cause, now_s)
        if child.process is None and child.due_s is not None and now_s >= child.due_s:
            self._start_program(child)

    def _start_program(self, child: SupervisedProcess) -> None:
        """Starts a program. A failure to start is treated like its end."""
        now_s = time.monotonic()
        try:
            child.start(now_s)
        except OSError as error:
            child.exit_code = _FAILED_START_CODE
            self._handle_end(child, f"the program cannot be started ({error.strerror or error})", now_s)
            return
        self._wake_at_end(child)

    def _wake_at_end(self, child: SupervisedProcess) -> None:
        """Makes the end of the program interrupt the wait between two checks (Linux)."""
        if child.process is None or sys.platform != "linux":
            return
        with contextlib.suppress(OSError):
            descriptor = os.pidfd_open(child.process.pid)
            self._end_descriptors[child] = descriptor
            self._selector.register(descriptor, selectors.EVENT_READ)

    def _close_end_descriptor(self, child: SupervisedProcess) -> None:
        """Closes the descriptor of a program that has ended."""
        descriptor = self._end_descriptors.pop(child, None)
        if descriptor is not None:
            self._selector.unregister(descriptor)
            os.close(descriptor)

    def _handle_end(self, child: SupervisedProcess, cause: str, now_s: float) -> None:
        """Schedules the restart of a program that has ended, or ends the run."""
        code, program = child.exit_code or 0, child.program
        is_planned = program.restart == "never" or (program.restart == "failure" and code == 0)
        if is_planned or child is self._starting:
            self._end_run_if_needed(child, cause)
            return
        wait_s = child.plan_restart(now_s, is_failure=cause != NIGHTLY_CAUSE)
        wait_text = f"in {wait_s:g} s" if wait_s else "at once"
        log.warning("the %s has ended: %s. The program starts again %s.", program.name, cause, wait_text)
        self._write_record("restart", lambda folders: _append_restart(folders, program.name, cause))

    def _end_run_if_needed(self, child: SupervisedProcess, cause: str) -> None:
        """Ends all programs after a program has ended. Does nothing if a program that does not lead has ended
        without a failure.
        """
        code, program = child.exit_code or 0, child.program
        # The leading program has printed the reason for its exit code itself.
        if code < 0 or (code and not program.leads):
            log.warning("the %s has ended: %s.", program.name, cause)
        if program.leads or code or child is self._starting:
            self._exit_code = exit_code_from_status(code)

    def _restart_if_night(self) -> None:
        """Ends all programs at the time of the nightly restart. They are then started again."""
        now_s = time.monotonic()
        if self._nightly.is_due(now_s, time.time()):
            for child in self._children:
                child.terminate(NIGHTLY_CAUSE, now_s, TERMINATION_GRACE_S)

    def _write_records(self) -> None:
        """Writes the state of each program, at a limited rate."""
        now_s = time.monotonic()
        if now_s - self._recorded_s < _RECORD_INTERVAL_S:
            return
        self._recorded_s = now_s
        if self._folders is None:
            return
        stored_records = {record.name: record for record in read_services(self._folders.runtime)}
        for child in self._children:
            record = child.create_record(now_s, time.time())
            if child.is_over or self._is_recorded_by_itself(record, stored_records.get(record.name)):
                continue
            self._records[record.name] = record
            self._write_record("state", lambda folders, record=record: write_service(record, folders.runtime))

    def _is_recorded_by_itself(self, record: ServiceRecord, present: ServiceRecord | None) -> bool:
        """Returns True if a running program writes its own state record, which contains more than the
        supervisor's record.
        """
        is_of_process = present is not None and record.pid != 0 and present.pid == record.pid
        return is_of_process and present != self._records.get(record.name)

    def _write_record(self, kind: str, write: Callable[[RecordFolders], None]) -> None:
        """Writes a record. Failures, such as a full disk, must not end the supervision, so they are only
        logged, once per kind of record.
        """
        if self._folders is None:
            return
        try:
            write(self._folders)
            self._unwritable.discard(kind)
        except (EnlivenError, OSError) as error:
            if kind not in self._unwritable:
                log.warning("the %s of a program cannot be recorded: %s", kind, error)
            self._unwritable.add(kind)

    def _end_all(self) -> None:
        """Ends all programs. Signals do not interrupt this method."""
        running: dict[str, subprocess.Popen[bytes]] = {
            child.program.name: child.process for child in self._children if child.process is not None
        }
        end_children(list(running.values()), TERMINATION_GRACE_S)
        self.exit_codes = {name: process.returncode for name, process in running.items()}
        for child in self._children:
            self._close_end_descriptor(child)
            child.close()

    @contextlib.contextmanager
    def _handle_signals(self) -> Iterator[None]:
        """Makes SIGTERM and Ctrl-C stop the run. Has no effect in a thread other than the main one."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def stop(signum: int, frame: object) -> None:
            self.stop()

        old_handlers = {number: signal.signal(number, stop) for number in (signal.SIGTERM, signal.SIGINT)}
        try:
            yield
        finally:
            for number, handler in old_handlers.items():
                signal.signal(number, handler)


def _append_restart(folders: RecordFolders, name: str, cause: str) -> None:
    """Adds a restart to the history."""
    append_restart(RestartRecord(name, time.time(), cause), folders.history)
