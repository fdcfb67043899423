"""The helper process: runs one driver and hands its frames to the edge.

It does what the edge says over a pipe, and ends when the pipe does, so that none is left when an edge dies.
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
from enliven_edge.sensors.isolation.slots import FrameSlots

_TURN = 0.1
"""Seconds that the driver may wait for an image before the edge is listened to again."""
_CONDITION_EVERY = 1.0
"""Seconds between two reports of temperature, link and gravity."""


def serve(pipe: Connection, kind: Callable[..., Sensor], options: dict[str, Any]) -> None:
    """Runs a sensor of the class ``kind`` until the edge lets the pipe go; the entry of the process."""
    # Ctrl-C reaches all processes of a terminal; the edge lets the device go and then ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # What a library prints is no answer to what the user asked.
    sys.stdout.flush()
    os.dup2(2, 1)
    told = _Pipe(pipe)
    logging.basicConfig(level=logging.INFO, handlers=[_Teller(told)], force=True)
    with contextlib.suppress(EOFError, OSError):
        _Helper(told, kind, options).run()


class _Helper:
    """What the process does between two words of the edge."""

    def __init__(self, pipe: _Pipe, kind: Callable[..., Sensor], options: dict[str, Any]) -> None:
        self._pipe, self._make = pipe, functools.partial(kind, **options)
        self._device: Sensor | None = None
        self._slots: FrameSlots | None = None
        self._camera: Intrinsics | None = None
        self._told, self._reading = 0.0, False

    def run(self) -> None:
        """Does what the edge says; reads a frame where it says nothing.

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
        """Opens the device."""
        try:
            self._device = self._make()
        except Exception as error:
            self._pipe.send(("failed", *_said(error)))
            return
        self._told, self._camera, self._reading = 0.0, None, False
        self._pipe.send(("opened", self._device.name, getattr(self._device, "fps", None)))

    def _go(self) -> None:
        """The edge is ready for frames; before that they would be old when it is."""
        self._reading = True

    def _close(self) -> None:
        """Lets the device go."""
        device, self._device = self._device, None
        if device is not None:
            device.close()
        self._pipe.send(("closed",))

    def _memory(self, name: str, size: int) -> None:
        """The edge has made room for images of so many bytes."""
        self._slots = FrameSlots.attach(name, size)
        self._pipe.send(("attached",))

    def _read(self, device: Sensor) -> None:
        """Hands on the next frame, or what happened in its place."""
        try:
            frame = device.read(_TURN)
        except TimeoutError:
            return
        except Exception as error:
            self._pipe.send(("bad" if isinstance(error, InputError) else "lost", *_said(error)))
            return
        if isinstance(frame, DepthFrame):
            self._hand_on(frame)
        elif isinstance(frame, BodyFrame):
            self._pipe.send(("bodies", frame))
        elif frame is None:
            self._pipe.send(("end",))
            self._device = None
            device.close()
        else:
            self._pipe.send(("bad", "", f"it is of type {type(frame).__name__}", device.name, ""))
        if self._device is not None and time.monotonic() - self._told > _CONDITION_EVERY:
            self._told = time.monotonic()
            self._pipe.send(("condition", getattr(device, "condition", lambda: None)()))

    def _hand_on(self, frame: DepthFrame) -> None:
        """Copies a frame into shared memory, and says where it is."""
        size = frame.depth.nbytes + (0 if frame.colour is None else frame.colour.nbytes)
        if self._slots is None or self._slots.size < size:
            self._slots = None
            self._pipe.send(("wants", size))
            while self._slots is None:
                word, *rest = self._pipe.recv()
                getattr(self, f"_{word}")(*rest)
                if self._device is None:
                    return
        slot = self._slots.write(frame.depth, frame.colour)
        if slot is None:
            return
        # A camera that stays the same is said once.
        camera = None if frame.intrinsics == self._camera else frame.intrinsics
        self._camera = frame.intrinsics
        colour = None if frame.colour is None else frame.colour.shape
        about = (frame.time_ns, frame.sequence, frame.sensor, frame.world_from_camera)
        self._pipe.send(("frame", slot, frame.depth.shape, colour, camera, about))


class _Pipe:
    """The edge's pipe, which the threads of a library may log into while a frame is handed on."""

    def __init__(self, pipe: Connection) -> None:
        self.poll, self.recv = pipe.poll, pipe.recv
        self._pipe, self._lock = pipe, threading.Lock()

    def send(self, message: tuple[Any, ...]) -> None:
        """One message."""
        with self._lock:
            self._pipe.send(message)


class _Teller(logging.Handler):
    """Hands log lines to the edge, which has the user's settings for them."""

    def __init__(self, pipe: _Pipe) -> None:
        super().__init__()
        self._pipe = pipe

    def emit(self, record: logging.LogRecord) -> None:
        """One line; none where the edge is gone."""
        try:
            self._pipe.send(("log", record.name, record.levelno, record.getMessage()))
        except OSError:
            return


def _said(error: Exception) -> tuple[str, str, str, str]:
    """(class, what, where, mend) of an error, as far as it says them."""
    if isinstance(error, EnlivenError):
        return type(error).__name__, error.what, error.where, error.mend
    return type(error).__name__, str(error) or type(error).__name__, "", ""
