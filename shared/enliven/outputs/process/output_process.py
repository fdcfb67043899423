"""Controls the process that sends live outputs: starts it, passes frames to it, and restarts it if it ends.

Encoding and sending a frame holds Python's global lock for most of a millisecond. In a separate process, this
work does not delay the program. The program only copies the numbers of a frame into a socket.
"""

from __future__ import annotations

import contextlib
import logging
import os
import selectors
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from enliven.health import HealthState
from enliven.kernel_cache.program import PROGRAM_VARIABLE
from enliven.outputs.depth_memory import DEPTH_INTERVAL_NS, DepthMemory, DepthReference
from enliven.outputs.frame_thread import MAX_EVENTS
from enliven.outputs.live_frame import LiveEvent, LiveFrame
from enliven.outputs.output_plan import OutputPlan
from enliven.outputs.process.frame_codec import FrameEncoder
from enliven.outputs.process.message_stream import MessageStream, make_connected_ends
from enliven.outputs.process.output_status import OutputStatus
from enliven.supervision.closeable import Closeable
from enliven.supervision.lifetime import block_interrupts
from enliven.supervision.schedule import RestartBackoff

log = logging.getLogger(__name__)

_MODULE = "enliven.outputs.process.sending_process"
"""The module that the process runs."""
_FLUSH_INTERVAL_S = 0.25
"""Interval in seconds between attempts to send a frame that did not fit into the socket buffer."""
_MAX_END_S = 5.0
"""Maximum time in seconds for a process to send the last frame and close its outputs."""
_MAX_START_S = 30.0
"""Maximum time in seconds that :meth:`OutputProcess.close` waits for a process that is still starting, if a
frame has not been sent."""
_MAX_EXIT_S = 2.0
"""Time in seconds from the end of the connection until the process is killed."""


class OutputProcess(Closeable):
    """The sending process, as a handle for the program. It receives the newest frame.

    :meth:`put` never blocks. If the process does not read, only the newest frame is kept. A thread starts the
    process and receives its reports. If the process ends, the thread restarts it after a delay.

    Args:
        plans: the checked settings of the outputs.

    Attributes:
        statuses: the state of each output.
    """

    def __init__(self, plans: Sequence[OutputPlan]) -> None:
        self.statuses = [OutputStatus(plan.name) for plan in plans]
        self._plans = tuple(plans)
        self._has_server = any(plan.protocol.listen is not None for plan in plans)
        self._replaced = self._skipped = self._skipped_before = 0
        self._lock = threading.Lock()  # Guards the attributes below. No code blocks while it holds the lock.
        self._running: _Running | None = None
        self._newest: LiveFrame | None = None
        self._events: deque[LiveEvent] = deque(maxlen=MAX_EVENTS)
        self._health: tuple[HealthState, ...] = ()
        self._ended, self._has_run = threading.Event(), False
        self._thread = threading.Thread(target=self._run, name="live outputs", daemon=True)
        self._thread.start()

    @property
    def is_ready(self) -> bool:
        """True if the process has opened its outputs."""
        running = self._running
        return running is not None and running.is_ready

    @property
    def process_id(self) -> int | None:
        """The id of the process, or None while no process runs."""
        running = self._running
        return None if running is None else running.process.pid

    @property
    def skipped(self) -> int:
        """Number of frames that were replaced before they were sent."""
        return self._replaced + self._skipped_before + self._skipped

    def put(self, frame: LiveFrame) -> None:
        """Passes a frame to the process. Returns immediately."""
        with self._lock:
            if self._newest is not None:
                self._replaced += 1
            self._newest = frame
            self._events.extend(frame.events)
            self._send_waiting()

    def put_health(self, states: Sequence[HealthState]) -> None:
        """Passes the edge's health states to the process. Returns immediately."""
        if not self._has_server:
            return
        with self._lock:
            self._health = tuple(states)
            self._send_waiting()

    def close(self) -> None:
        """Sends the last queued frame, and ends the process. A second call does nothing."""
        self._ended.set()
        with self._lock:
            self._send_waiting()
        self._thread.join(_MAX_END_S if self.is_ready else _MAX_START_S)
        with self._lock:
            if self._running is not None:
                self._running.process.kill()
        self._thread.join(_MAX_EXIT_S)

    def _send_waiting(self) -> None:
        """Sends all queued messages without blocking. The caller must hold the lock.

        If the output is closing, then closes the write end of the connection, which ends the process.
        """
        running = self._running
        if running is None or not running.is_ready:
            if running is not None and self._ended.is_set() and self._newest is None:
                running.process.kill()  # No frame was sent, so nothing is lost.
            return
        try:
            is_free = running.stream.flush()
            if is_free and self._health != running.health:
                running.health = self._health
                is_free = running.stream.send_without_waiting("health", self._health)
            if is_free and self._newest is not None:
                frame, events, self._newest = self._newest, self._events, None
                if len(events) != len(frame.events):
                    frame = replace(frame, events=tuple(events))
                events.clear()
                is_free = running.send(frame)
            if is_free and self._ended.is_set():
                running.stream.socket.shutdown(socket.SHUT_WR)
        except OSError:
            pass  # The process has ended. The thread detects this, too.

    def _run(self) -> None:
        """Runs the process, and restarts it whenever it ends."""
        backoff = RestartBackoff()
        while not self._ended.is_set() or self._waits_for_first_process():
            start = time.monotonic()
            reason = self._run_once()
            self._has_run = True
            self._skipped_before, self._skipped = self._skipped_before + self._skipped, 0
            if self._ended.is_set():
                break
            wait_s = backoff.wait_after(time.monotonic() - start)
            when = f"in {wait_s:.0f} s" if wait_s else "now"
            log.warning(
                "the process of the live outputs has ended: %s. The process starts again %s. Until "
                "then, no frames "
                "are sent.",
                *(reason, when),
            )
            for status in self.statuses:
                status.end_process(f"the process of the live outputs has ended ({reason}) and starts again")
            self._ended.wait(wait_s)

    def _waits_for_first_process(self) -> bool:
        """Returns True if a frame is queued for the first process, which is not ready yet. This happens if
        the program ends very early."""
        return self._newest is not None and not self._has_run

    def _run_once(self) -> str:
        """Runs the process until it ends. Returns the reason as text."""
        try:
            running = _Running(self._plans, self._has_server)
        except OSError as error:
            return f"the process cannot be started ({error.strerror or error})"
        try:
            with self._lock:
                self._running = running
            self._receive(running)
        finally:
            with self._lock:
                self._running = None
            code = running.end()
        return running.failure.rstrip(".") or _describe_exit(code)

    def _receive(self, running: _Running) -> None:
        """Receives the reports of the process until it closes the connection."""
        with selectors.DefaultSelector() as selector:
            selector.register(running.stream.socket, selectors.EVENT_READ)
            while True:
                with self._lock:
                    self._send_waiting()
                if selector.select(_FLUSH_INTERVAL_S):
                    messages = running.stream.receive()
                    if messages is None:
                        return
                    for kind, content in messages:
                        self._handle_report(running, kind, content)

    def _handle_report(self, running: _Running, kind: str, content: Any) -> None:
        """Handles one report of the process."""
        match kind:
            case "ready":
                log.debug("the process of the live outputs is ready")
                for status in self.statuses:
                    status.trouble = ""
                running.is_ready = True
            case "state":
                self._skipped, running.wants_depth, rows = content
                for status, row in zip(self.statuses, rows, strict=True):
                    status.add_counts(*row)
            case "log":
                name, level, text = content
                logging.getLogger(name).log(level, "%s", text)
            case "failed":
                running.failure = content


class _Running:
    """One process, with its connection and the shared memory for depth images.

    Raises:
        OSError: if it cannot be started.
    """

    def __init__(self, plans: Sequence[OutputPlan], has_server: bool) -> None:
        self.is_ready = self.wants_depth = False
        self.failure, self.health = "", tuple[HealthState, ...]()
        self._encoder, self._last_depth_ns = FrameEncoder(), -DEPTH_INTERVAL_NS
        self._depth: DepthMemory | None = None
        with contextlib.ExitStack() as stack:
            near, far = make_connected_ends()
            stack.callback(near.close)
            with far:
                if has_server:
                    self._depth = stack.enter_context(DepthMemory())
                self.process = _start(far, self._depth)
            self.stream = MessageStream(near)
            stack.callback(self.end)
            self.stream.send("open", (tuple(plans), None if self._depth is None else self._depth.handle))
            near.setblocking(False)
            stack.pop_all()

    def send(self, frame: LiveFrame) -> bool:
        """Sends a frame without waiting. Returns True if the system has taken all of it.

        Raises:
            OSError: if the process has ended.
        """
        return self.stream.send_without_waiting(
            "frame", self._encoder.encode(frame, self._share_depth(frame))
        )

    def end(self) -> int:
        """Closes the connection, waits for the end of the process, and returns its exit code."""
        with contextlib.suppress(OSError):
            self.stream.socket.shutdown(socket.SHUT_WR)
        try:
            code = self.process.wait(_MAX_EXIT_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            code = self.process.wait()
        self.stream.socket.close()
        if self._depth is not None:
            self._depth.close()
        return code

    def _share_depth(self, frame: LiveFrame) -> DepthReference | None:
        """Copies the depth image into shared memory, if an output sends it and the last one is old enough."""
        if self._depth is None or not self.wants_depth or frame.depth is None:
            return None
        if 0 <= frame.time_ns - self._last_depth_ns < DEPTH_INTERVAL_NS:
            return None
        self._last_depth_ns = frame.time_ns
        return self._depth.write(frame.depth)


def _start(far: socket.socket, depth: DepthMemory | None) -> subprocess.Popen[bytes]:
    """Starts the process with its end of the connection.

    Raises:
        OSError: if it cannot be started.
    """
    environment = {"OPENBLAS_NUM_THREADS": "1", **os.environ}
    # The process is not the program. It must not compile native kernels for it.
    environment.pop(PROGRAM_VARIABLE, None)
    command = [sys.executable, "-m", _MODULE]
    if sys.platform == "win32":
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, env=environment)
        assert process.stdin is not None
        with process.stdin:
            process.stdin.write(far.share(process.pid))
        return process
    descriptors = [far.fileno()]
    if depth is not None:
        descriptors.append(int(depth.handle))
    with block_interrupts():
        return subprocess.Popen(
            [*command, str(far.fileno())],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            env=environment,
            pass_fds=descriptors,
        )


def _describe_exit(code: int) -> str:
    """Returns how a process has ended, in words."""
    return f"signal {-code} ended the process" if code < 0 else f"the exit code was {code}"
