"""The edge's side of a helper process: sends requests to it and receives its frames."""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from enliven.camera import Intrinsics
from enliven.errors import InputError, ResourceError
from enliven.frames import DepthFrame
from enliven_edge.sensors.base import Sensor, SensorFault
from enliven_edge.sensors.crash_reports import keep_text
from enliven_edge.sensors.isolation.crash_traceback import CrashTraceback
from enliven_edge.sensors.isolation.helper import serve
from enliven_edge.sensors.isolation.slots import SLOTS, FrameSlots, slots_for_all

SILENCE_TIMEOUT_S = 1.0
"""Seconds without an image after which a device counts as lost, even if its library reports no error: thirty
frames."""
OPEN_TIMEOUT_S = 45.0
"""Maximum seconds for opening. A library that searches a network needs about twenty."""
_CLOSE_TIMEOUT_S = 0.4
"""Seconds that a driver has to close its device before its process is killed."""
_MAX_WAITING_IMAGES = 3
"""Maximum number of images that wait for the edge. If there are more, the oldest are dropped, so that a pause
causes no lag."""


class HelperProcess:
    """A running helper process.

    Raises:
        ResourceError: if it cannot be started.
    """

    def __init__(
        self, name: str, kind: Callable[..., Sensor], options: dict[str, Any], every_frame: bool = False
    ) -> None:
        context = multiprocessing.get_context("spawn")
        self._name, self._every = name, every_frame
        self._pipe: Connection
        self._pipe, far = context.Pipe()
        self._words = CrashTraceback(context)
        arguments = (far, kind, options, every_frame, self._words.far)
        self._process = context.Process(target=serve, args=arguments, name=f"sensor {name}", daemon=True)
        try:
            self._process.start()
        except OSError as error:
            raise ResourceError(
                f"the process of the driver cannot be started ({error})", where=name
            ) from None
        far.close()
        self._words.close_child_end()
        self._slots: FrameSlots | None = None
        self._camera: Intrinsics | None = None
        self._waiting: list[tuple[Any, ...]] = []

    @property
    def is_alive(self) -> bool:
        """Returns True while the process runs."""
        return self._process.is_alive()

    def open(self) -> tuple[str, float | None, dict[str, Any]]:
        """Opens the device. Returns the sensor's name, its frame rate, and the options that open it again.

        Raises:
            InputError, ResourceError: the driver's error, or the end of its process.
        """
        self._send_request("open")
        message = self._answer(OPEN_TIMEOUT_S, "opened", "failed")
        if message is None:
            self.end()
            raise ResourceError(
                f"opening the device took more than {OPEN_TIMEOUT_S:.0f} s",
                where=self._name,
                remedy="Unplug the device and plug it in again.",
            )
        if message[0] == "failed":
            raise error_from_helper(message[1:], self._name, ResourceError)
        name, fps, reopens = message[1:]
        return name, fps, reopens

    def start_frames(self) -> None:
        """Starts the frames.

        Raises:
            SensorFault: if the process has ended.
        """
        self._send_request("start_frames")

    def receive(self, timeout: float) -> tuple[Any, ...] | None:
        """Returns the next message for the sensor. Returns None if no message arrives within ``timeout``
        seconds.

        Raises:
            SensorFault: if the process has ended.
        """
        self._fetch(timeout)
        frames = sum(message[0] == "frame" for message in self._waiting)
        while self._waiting:
            message = self._waiting.pop(0)
            if message[0] != "frame":
                return message
            frames -= 1
            if self._every or frames < _MAX_WAITING_IMAGES:
                return message
            self._skip(*message[1:])
        return None

    def frame(
        self,
        slots: FrameSlots,
        slot: int,
        shape: tuple[int, int],
        colour: tuple[int, ...] | None,
        camera: Intrinsics | None,
        header: tuple[int, int | None, str, Any],
    ) -> DepthFrame:
        """Returns the frame of a message, with its images in shared memory."""
        self._camera = camera or self._camera
        assert self._camera is not None
        depth, seen = slots.read(slot, shape, colour)
        time_ns, sequence, name, pose = header
        return DepthFrame(depth, self._camera, time_ns, name, seen, pose, sequence)

    def end(self) -> None:
        """Closes the device and ends the process. Kills the process if it does not end."""
        with contextlib.suppress(SensorFault):
            self._send_request("close")
            self._answer(_CLOSE_TIMEOUT_S, "closed")
        self._pipe.close()
        self._words.close()
        self._process.join(0.05)
        for force in (self._process.terminate, self._process.kill):
            if self._process.is_alive():
                force()
                self._process.join(0.2)

    def _skip(
        self, slots: FrameSlots, slot: int, _shape: Any, _colour: Any, camera: Intrinsics | None, _about: Any
    ) -> None:
        """Drops a frame that is too old. Its intrinsics are stored, because they may be new."""
        self._camera = camera or self._camera
        slots.release(slot)

    def _send_request(self, *message: Any) -> None:
        try:
            self._pipe.send(message)
        except OSError:
            raise self._end_fault() from None

    def _answer(self, seconds: float, *words: str) -> tuple[Any, ...] | None:
        """Returns the next message that starts with one of ``words``, or None if none arrives in time."""
        deadline = time.monotonic() + seconds
        while (remaining := deadline - time.monotonic()) > 0:
            message = self.receive(remaining)
            if message is not None and message[0] in words:
                return message
        return None

    def _fetch(self, timeout: float) -> None:
        """Receives all messages that have arrived. Waits up to ``timeout`` seconds for the first."""
        while self._pipe.poll(0 if self._waiting else timeout):
            try:
                message = self._pipe.recv()
            except (EOFError, OSError):
                if self._waiting:
                    return
                raise self._end_fault() from None
            match message:
                case ("log", name, level, text):
                    logging.getLogger(name).log(level, "%s", text)
                case ("wants", size):
                    self._make_room(size)
                case ("attached",):
                    pass
                case ("frame", *about):
                    # Store the current shared memory with the message, because ``self._slots`` may have been
                    # replaced before the message is read.
                    self._waiting.append(("frame", self._slots, *about))
                case _:
                    self._waiting.append(message)

    def _make_room(self, size: int) -> None:
        """Creates shared memory for images of ``size`` bytes. Earlier memory is kept while frames use it."""
        count = slots_for_all(size) if self._every else SLOTS
        self._slots = FrameSlots.make(size, count)
        self._send_request("memory", self._slots.name, size, count)
        while self._pipe.poll(_CLOSE_TIMEOUT_S + SILENCE_TIMEOUT_S):
            try:
                message = self._pipe.recv()
            except (EOFError, OSError):
                raise self._end_fault() from None
            if message == ("attached",):
                break
            self._waiting.append(message)
        self._slots.forget()

    def _end_fault(self) -> SensorFault:
        """Returns the error for a process that has ended. Stores a report if the process crashed."""
        self._process.join(_CLOSE_TIMEOUT_S)
        code = self._process.exitcode
        reason = f"the driver crashed (signal {-code})" if code and code < 0 else "the driver ended"
        if code and code < 0 and (report := self._words.read()):
            keep_text(self._name, report, -code)
        return SensorFault(
            reason,
            where=self._name,
            remedy="The driver is restarted automatically. The log contains the details.",
        )


def error_from_helper(
    description: tuple[str, str, str, str], name: str, kind: type[InputError] | type[ResourceError]
) -> InputError | ResourceError:
    """Converts a driver's error, received as strings, to an exception.

    An InputError keeps its class. All other errors become ``kind``.
    """
    error_class, problem, where, remedy = description
    error_type = {"InputError": InputError, "ResourceError": kind}.get(error_class, kind)
    if kind is InputError:
        error_type = InputError
    return error_type(problem, where=where or name, remedy=remedy)
