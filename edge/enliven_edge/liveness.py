"""Reports the edge's progress to its supervisor, and its state to the health page."""

from __future__ import annotations

import contextlib
import logging
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from enliven.errors import EnlivenError
from enliven.health import Severity
from enliven.supervision.closeable import Closeable
from enliven.supervision.notify import Notifier
from enliven.supervision.records import RUNTIME_VARIABLE, ServiceRecord, runtime_folder, write_service
from enliven.wire import StatusMessage

log = logging.getLogger(__name__)

MAX_OPENING_S = 60.0
"""Maximum seconds for opening the cameras. A library that searches the network for cameras needs 20."""
MAX_PREPARATION_S = 900.0
"""Maximum seconds for preparing the characters. A small computer needs ten minutes to compile the kernels."""
_EXTENSION_INTERVAL_S = 5.0
"""Seconds between two requests to the supervisor for more time during the start."""
_EXTENSION_S = 15.0
"""Seconds of additional time per request. It is three intervals, because a busy computer may delay a
request."""
_REPORT_INTERVAL_S = 0.5
"""Seconds between two reports of progress. The supervisor's watchdog waits for several seconds."""
_RECORD_INTERVAL_S = 1.0
"""Seconds between two writes of the state. The health page shows whole seconds."""


@contextlib.contextmanager
def extend_start_timeout(notifier: Notifier, max_s: float) -> Iterator[None]:
    """Asks the supervisor for more time while a step of the start runs, for at most ``max_s`` seconds."""
    if not notifier.is_supervised:
        yield
        return
    is_over = threading.Event()

    def extend() -> None:
        end = time.monotonic() + max_s
        notifier.extend_timeout(_EXTENSION_S)
        while not is_over.wait(_EXTENSION_INTERVAL_S) and time.monotonic() < end:
            notifier.extend_timeout(_EXTENSION_S)

    thread = threading.Thread(target=extend, name="start", daemon=True)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()


class ProgressReporter(Closeable):
    """Reports the main loop's progress to the supervisor, and writes the edge's state once per second.

    Both happen on a separate thread, because a system call may delay a frame. The thread reports progress
    only if the loop has made progress since the last report.

    Progress means that a frame was received and published, or that the sensor is waiting
    (:attr:`enliven_edge.sensors.base.Sensor.is_waiting`). Nothing else counts. So the supervisor restarts an
    edge if its loop, driver or network hangs.

    Args:
        notifier: the supervisor, or None.
        name: the edge's name.
        status: returns the edge's heartbeat. It is called on the separate thread.
        folder: the runtime folder. If None, uses the default folder, and only if there is a supervisor or
            :data:`~enliven.supervision.records.RUNTIME_VARIABLE` is set.
    """

    def __init__(
        self,
        notifier: Notifier | None = None,
        name: str = "edge",
        status: Callable[[], StatusMessage] | None = None,
        folder: Path | None = None,
    ) -> None:
        self._notifier = notifier or Notifier("")
        self._name, self._status = f"edge {name}" if name != "edge" else name, status
        self._started_s = time.time()
        self._is_ready = self._has_failed = False
        self._progress_at: float | None = None
        self._sentence = ""
        self._frames = 0
        self._temperature: float | None = None
        self._folder = folder
        self._ended, self._wakes = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None
        self._writes = status is not None and bool(
            folder or self._notifier.is_supervised or RUNTIME_VARIABLE in os.environ
        )
        if self._writes or self._notifier.is_supervised:
            self._thread = threading.Thread(target=self._run, name="state", daemon=True)
            self._thread.start()

    def publish_frame(self, temperature: float | None = None) -> None:
        """Reports that a frame was received and published.

        Args:
            temperature: temperature of the camera in degrees Celsius, if known.
        """
        self._frames += 1
        self._temperature = temperature
        self._report_progress("frames are published")

    def wait(self, sensor: str) -> None:
        """Reports progress while no frames arrive because the sensor is waiting."""
        self._report_progress(f"waiting for {sensor}")

    def end_iteration(self) -> None:
        """Reports after the first iteration of the main loop that the edge has started. Call it in every
        iteration."""
        if not self._is_ready:
            self._is_ready = True
            self._notifier.report_ready("the edge runs")

    def close(self) -> None:
        """Reports that the edge ends, and writes its state for the last time."""
        if self._ended.is_set():
            return
        self._ended.set()
        self._wakes.set()
        if self._thread is not None:
            self._thread.join(_RECORD_INTERVAL_S)
        self._notifier.report_stopping()
        self._notifier.close()

    def _report_progress(self, sentence: str) -> None:
        is_first = self._progress_at is None
        self._sentence, self._progress_at = sentence, time.monotonic()
        if is_first:
            self._wakes.set()  # The health page shows immediately that the edge is back.

    def _run(self) -> None:
        """Reports progress and writes the state until the edge ends."""
        reported_at, recorded_at, has_ended = None, time.monotonic(), False
        while not has_ended:
            self._wakes.wait(_REPORT_INTERVAL_S)
            self._wakes.clear()
            has_ended = self._ended.is_set()
            progress_at, now = self._progress_at, time.monotonic()
            is_first = reported_at is None and progress_at is not None
            if progress_at != reported_at:
                reported_at = progress_at
                self._notifier.report_progress(self._sentence)
            if self._writes and (has_ended or is_first or now - recorded_at >= _RECORD_INTERVAL_S):
                recorded_at = now
                self._write_record()

    def _write_record(self) -> None:
        """Writes the state. Logs only the first failure."""
        try:
            write_service(self._record(), self._folder or runtime_folder())
        except (EnlivenError, OSError) as error:
            if not self._has_failed:
                log.warning("the state for the health page cannot be written (%s)", error)
            self._has_failed = True

    def _record(self) -> ServiceRecord:
        """Returns the current state."""
        assert self._status is not None
        status, progress_at = self._status(), self._progress_at
        ago = None if progress_at is None else time.monotonic() - progress_at
        figures = {
            "fps": status.fps,
            "latency_p50_ms": status.latency_p50_ms,
            "latency_p99_ms": status.latency_p99_ms,
            "performers": float(status.performers),
            "frames": float(self._frames),
        }
        if (rss := resident_mb()) is not None:
            figures["rss_mb"] = rss
        if self._temperature is not None:
            figures["temperature_c"] = self._temperature
        return ServiceRecord(
            self._name,
            os.getpid(),
            self._started_s,
            0.0 if ago is None else time.time() - ago,
            _describe_status(status),
            figures,
        )


def _describe_status(status: StatusMessage) -> str:
    """Returns the worst problem in a heartbeat, or else the edge's activity."""
    if status.health and status.health[0].severity >= Severity.WARNING:
        return status.health[0].what
    return f"{status.phase}, {status.sensor}" if status.sensor else status.phase


def resident_mb() -> float | None:
    """Returns this process's resident memory in megabytes, or None if the system does not report it."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except (OSError, ValueError, IndexError):
        return None
    return pages * os.sysconf("SC_PAGE_SIZE") * 1e-6
