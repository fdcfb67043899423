"""The helper process: runs one driver and sends its frames to the edge.

It handles the edge's requests from a pipe. It ends when the pipe is closed, so that it does not outlive the
edge.
"""

from __future__ import annotations

import contextlib
import functools
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from enliven.camera import Intrinsics
from enliven.errors import EnlivenError, InputError
from enliven.frames import BodyFrame, DepthFrame
from enliven_edge.sensors.base import Sensor
from enliven_edge.sensors.isolation.crash_traceback import enable_crash_report
from enliven_edge.sensors.isolation.slots import FrameSlots

_READ_TIMEOUT_S = 0.1
"""Seconds that the driver may wait for an image before the next request is handled."""
_SLOT_POLL_S = 0.005
"""Seconds between two checks for a free slot if no frame may be dropped. It is half a fast camera's frame
interval. A request that arrives in the meantime is handled first."""
_CONDITION_INTERVAL_S = 1.0
"""Seconds between two reports of temperature, link and gravity."""


def serve(
    pipe: Connection,
    kind: Callable[..., Sensor],
    options: dict[str, Any],
    every_frame: bool = False,
    words: Connection | None = None,
) -> None:
    """Runs a sensor of the class ``kind`` until the edge closes the pipe. The entry point of the process.

    ``kind`` creates the sensor from ``options``. Python's report of a crash is written to ``words``.
    """
    enable_crash_report(words)
    # Ignore Ctrl-C here, because it reaches all processes of a terminal. The edge first releases the device,
    # and then ends this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Redirect the standard output, because prints of a library must not mix with the program's own output.
    sys.stdout.flush()
    os.dup2(2, 1)
    shared_pipe = _Pipe(pipe)
    logging.basicConfig(level=logging.INFO, handlers=[_PipeLogHandler(shared_pipe)], force=True)
    with contextlib.suppress(EOFError, OSError):
        _Helper(shared_pipe, kind, options, every_frame).run()


class _Helper:
    """The state of the process, with a method for each request of the edge."""

    def __init__(
        self, pipe: _Pipe, kind: Callable[..., Sensor], options: dict[str, Any], every_frame: bool
    ) -> None:
        self._pipe, self._make, self._every = pipe, functools.partial(kind, **options), every_frame
        self._device: Sensor | None = None
        self._slots: FrameSlots | None = None
        self._camera: Intrinsics | None = None
        self._told, self._reading = 0.0, False

    def run(self) -> None:
        """Handles requests, and reads frames between them.

        Raises:
            EOFError: when the edge is gone.
        """
        while True:
            if self._device is None or not self._reading or self._pipe.poll(0):
                word, *rest = self._pipe.recv()
                getattr(self, f"_{word}")(*rest)
            else:
                self._read(self._device)

    def _open(self) -> None:
        try:
            self._device = self._make()
        except Exception as error:
            self._pipe.send(("failed", *_describe_error(error)))
            return
        self._told, self._camera, self._reading = 0.0, None, False
        self._pipe.send(("opened", self._device.name, self._device.fps, dict(self._device.again)))

    def _start_frames(self) -> None:
        """Handles the request to start reading frames. Earlier frames would be outdated when the edge reads
        them.
        """
        self._reading = True

    def _close(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            device.close()
        self._pipe.send(("closed",))

    def _memory(self, name: str, size: int, count: int) -> None:
        """Handles the request to attach to shared memory for ``count`` images of ``size`` bytes."""
        self._slots = FrameSlots.attach(name, size, count)
        self._pipe.send(("attached",))

    def _read(self, device: Sensor) -> None:
        """Sends the next frame to the edge, or the error that occurred instead."""
        try:
            frame = device.read(_READ_TIMEOUT_S)
        except TimeoutError:
            return
        except Exception as error:
            self._pipe.send(("bad" if isinstance(error, InputError) else "lost", *_describe_error(error)))
            return
        if isinstance(frame, DepthFrame):
            self._send_frame(frame)
        elif isinstance(frame, BodyFrame):
            self._pipe.send(("bodies", frame))
        elif frame is None:
            self._pipe.send(("end",))
            self._device = None
            device.close()
        else:
            self._pipe.send(("bad", "", "the driver returned neither an image nor bodies", device.name, ""))
        if self._device is not None and time.monotonic() - self._told > _CONDITION_INTERVAL_S:
            self._told = time.monotonic()
            self._pipe.send(("condition", device.condition()))

    def _send_frame(self, frame: DepthFrame) -> None:
        """Copies a frame into shared memory, and sends its slot."""
        size = frame.depth.nbytes + (0 if frame.colour is None else frame.colour.nbytes)
        if self._slots is None or self._slots.size < size:
            self._slots = None
            self._pipe.send(("wants", size))
            while self._slots is None:
                word, *rest = self._pipe.recv()
                getattr(self, f"_{word}")(*rest)
                if self._device is None:
                    return
        while (slot := self._slots.write(frame.depth, frame.colour)) is None:
            if not self._every or self._pipe.poll(_SLOT_POLL_S):
                return
        # Send the intrinsics only when they change.
        camera = None if frame.intrinsics == self._camera else frame.intrinsics
        self._camera = frame.intrinsics
        colour = None if frame.colour is None else frame.colour.shape
        header = (frame.time_ns, frame.sequence, frame.sensor, frame.world_from_camera)
        self._pipe.send(("frame", slot, frame.depth.shape, colour, camera, header))


class _Pipe:
    """The pipe to the edge. It has a lock, because the threads of a library may log into it while a frame is
    sent.
    """

    def __init__(self, pipe: Connection) -> None:
        self.poll, self.recv = pipe.poll, pipe.recv
        self._pipe, self._lock = pipe, threading.Lock()

    def send(self, message: tuple[Any, ...]) -> None:
        """Sends one message."""
        with self._lock:
            self._pipe.send(message)


class _PipeLogHandler(logging.Handler):
    """Sends log lines to the edge, where the user's log settings apply."""

    def __init__(self, pipe: _Pipe) -> None:
        super().__init__()
        self._pipe = pipe

    def emit(self, record: logging.LogRecord) -> None:
        """Sends one line, unless the edge is gone."""
        try:
            self._pipe.send(("log", record.name, record.levelno, record.getMessage()))
        except OSError:
            return


def _describe_error(error: Exception) -> tuple[str, str, str, str]:
    """Returns (class, what, where, remedy) of an error, with empty strings for missing parts."""
    if isinstance(error, EnlivenError):
        return type(error).__name__, error.what, error.where, error.remedy
    return type(error).__name__, str(error) or "the reason is unknown", "", ""
