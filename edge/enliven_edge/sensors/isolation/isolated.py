"""A sensor in a helper process, as the edge sees it: frames come from shared memory, silence is a loss."""

from __future__ import annotations

import contextlib
import functools
import logging
import math
import multiprocessing
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any, cast

from enliven.camera import Intrinsics
from enliven.errors import InputError, ResourceError
from enliven.frames import DepthFrame, Frame
from enliven_edge.sensors.base import CHECK_IT, Condition, Sensor, SensorFault
from enliven_edge.sensors.crash_reports import keep_text
from enliven_edge.sensors.isolation.helper import serve
from enliven_edge.sensors.isolation.last_words import LastWords
from enliven_edge.sensors.isolation.slots import SLOTS, FrameSlots, slots_for_all

log = logging.getLogger(__name__)

SILENT = 1.0
"""Seconds without an image after which a device is lost, whatever its library says: thirty images' time."""
FIRST_IMAGE = 10.0
"""Seconds that the first image may take: firmware is loaded, exposure is found."""
OPENING = 45.0
"""Seconds that opening may take; a library that searches a network needs some twenty."""
_CLOSING = 0.4
"""Seconds that a driver has to let its device go, before its process is ended."""
_MOST_WAITING = 3
"""Images that may wait for the edge; of more the oldest are left out: a pause becomes no lag."""


class IsolatedOpener:
    """Opens a sensor in a helper process, a fresh one for each device.

    A library's own state does not outlive its device in this way. Of several devices that could be meant it
    is the one of before: a driver says by its ``again`` with which options.

    Args:
        name: of the sensor, for what is said of it before it is open.
        kind: the sensor's class, at the top of a module that the helper process can import.
        options: what the class takes.
        every_frame: images wait for a slow reader, as many as fit into memory; else the oldest are left out.
    """

    def __init__(
        self, name: str, kind: Callable[..., Sensor], options: dict[str, Any], every_frame: bool = False
    ) -> None:
        self._start = functools.partial(HelperProcess, name, kind, every_frame=every_frame)
        self._options = options
        self._idle: HelperProcess | None = None
        self._patient = False

    def patient(self) -> None:
        """From now on attempts that fail share one process, which :meth:`close` ends."""
        self._patient = True

    def __call__(self) -> IsolatedSensor:
        """The sensor, opened.

        Raises:
            InputError: for options that cannot be used.
            ResourceError: where the device is missing or taken, or the library crashes.
        """
        helper, self._idle = self._idle or self._start(self._options), None
        try:
            name, fps, again = helper.open()
        except (InputError, ResourceError):
            if self._patient and helper.alive:
                self._idle = helper
            else:
                helper.end()
            raise
        self._options = {**self._options, **again}
        return IsolatedSensor(helper, name, fps)

    def close(self) -> None:
        """Ends the process of attempts that failed."""
        helper, self._idle = self._idle, None
        if helper is not None:
            helper.end()


class IsolatedSensor(Sensor):
    """A :class:`~enliven_edge.sensors.base.Sensor` whose driver runs in a helper process.

    Its frames lie in shared memory, read-only, and stay as they are for as long as they are kept.

    Args:
        helper: a process that has the device open.
        name, fps: as the driver says them.
    """

    def __init__(self, helper: HelperProcess, name: str, fps: float | None) -> None:
        self._helper, self.name, self.fps = helper, name, fps
        self._condition: Condition | None = None
        self._heard, self._patience = -math.inf, FIRST_IMAGE
        self._closed = False

    def condition(self) -> Condition | None:
        """How the device fared when it was last asked."""
        return self._condition

    def read(self, timeout: float | None = None) -> Frame | None:
        """The next frame, or one of the newest where many wait; None when the stream has ended.

        Raises:
            TimeoutError: when none came in time.
            InputError: for a frame that cannot be used.
            SensorFault: where the device, its library or the process was lost.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        if self._heard == -math.inf and not self._closed:
            self._helper.go()
            self._heard = time.monotonic()
        while not self._closed:
            left = self._heard + self._patience - time.monotonic()
            wait = left if deadline is None else min(left, deadline - time.monotonic())
            message = self._helper.receive(max(wait, 0.0))
            if message is None:
                if time.monotonic() >= self._heard + self._patience:
                    why = f"no image for {self._patience:.0f} s"
                    raise SensorFault(why, where=self.name, mend=CHECK_IT)
                raise TimeoutError(f"no image of {self.name} yet")
            frame = self._understood(*message)
            if frame is not None:
                return frame
        return None

    def close(self) -> None:
        """Lets the device and its process go; a second call does nothing."""
        if not self._closed:
            self._closed = True
            self._helper.end()

    def _understood(self, word: str, *rest: Any) -> Frame | None:
        """The frame of a message, or None for other messages."""
        match word:
            case "frame":
                self._heard, self._patience = time.monotonic(), SILENT
                return self._helper.frame(*rest)
            case "bodies":
                self._heard, self._patience = time.monotonic(), SILENT
                (bodies,) = rest
                return cast(Frame, bodies)
            case "condition":
                (self._condition,) = rest
            case "bad":
                self._heard = time.monotonic()
                raise _error(rest, self.name, InputError)
            case "lost":
                raise _error(rest, self.name, SensorFault)
            case "end":
                self.close()
        return None


class HelperProcess:
    """The process and what is said to it.

    Raises:
        ResourceError: where it cannot be started.
    """

    def __init__(
        self, name: str, kind: Callable[..., Sensor], options: dict[str, Any], every_frame: bool = False
    ) -> None:
        context = multiprocessing.get_context("spawn")
        self._name, self._every = name, every_frame
        self._pipe: Connection
        self._pipe, far = context.Pipe()
        self._words = LastWords(context)
        arguments = (far, kind, options, every_frame, self._words.far)
        self._process = context.Process(target=serve, args=arguments, name=f"sensor {name}", daemon=True)
        try:
            self._process.start()
        except OSError as error:
            raise ResourceError(f"its process cannot be started ({error})", where=name) from None
        far.close()
        self._words.started()
        self._slots: FrameSlots | None = None
        self._camera: Intrinsics | None = None
        self._waiting: list[tuple[Any, ...]] = []

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process.is_alive()

    def open(self) -> tuple[str, float | None, dict[str, Any]]:
        """Opens the device; returns the sensor's name and frame rate, and with what it is opened again.

        Raises:
            InputError, ResourceError: what the driver said, or that its process ended.
        """
        self._say("open")
        message = self._answer(OPENING, "opened", "failed")
        if message is None:
            self.end()
            raise ResourceError(
                f"opening has taken more than {OPENING:.0f} s", where=self._name, mend="Unplug it once."
            )
        if message[0] == "failed":
            raise _error(message[1:], self._name, ResourceError)
        name, fps, again = message[1:]
        return name, fps, again

    def go(self) -> None:
        """Lets the frames come.

        Raises:
            SensorFault: where the process has ended.
        """
        self._say("go")

    def receive(self, timeout: float) -> tuple[Any, ...] | None:
        """The next message for the sensor within so many seconds; None where there is none.

        Raises:
            SensorFault: where the process has ended.
        """
        self._fetch(timeout)
        frames = sum(message[0] == "frame" for message in self._waiting)
        while self._waiting:
            message = self._waiting.pop(0)
            if message[0] != "frame":
                return message
            frames -= 1
            if self._every or frames < _MOST_WAITING:
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
        about: tuple[int, int | None, str, Any],
    ) -> DepthFrame:
        """The frame that a message tells of."""
        self._camera = camera or self._camera
        assert self._camera is not None
        depth, seen = slots.read(slot, shape, colour)
        time_ns, sequence, name, stand = about
        return DepthFrame(depth, self._camera, time_ns, name, seen, stand, sequence)

    def end(self) -> None:
        """Lets the device go and ends the process, by force where it does not do so itself."""
        with contextlib.suppress(SensorFault):
            self._say("close")
            self._answer(_CLOSING, "closed")
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
        """A frame that came too long ago is not used; its camera may be new."""
        self._camera = camera or self._camera
        slots.release(slot)

    def _say(self, *message: Any) -> None:
        try:
            self._pipe.send(message)
        except OSError:
            raise self._lost() from None

    def _answer(self, seconds: float, *words: str) -> tuple[Any, ...] | None:
        """The message that begins with one of some words; None where it does not come in time."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            message = self.receive(left)
            if message is not None and message[0] in words:
                return message
        return None

    def _fetch(self, timeout: float) -> None:
        """Takes what has come; waits for the first message for so long."""
        while self._pipe.poll(0 if self._waiting else timeout):
            try:
                message = self._pipe.recv()
            except (EOFError, OSError):
                if self._waiting:
                    return
                raise self._lost() from None
            match message:
                case ("log", name, level, text):
                    logging.getLogger(name).log(level, "%s", text)
                case ("wants", size):
                    self._make_room(size)
                case ("attached",):
                    pass
                case ("frame", *about):
                    # Where its image lies: there may be other memory by the time that it is wanted.
                    self._waiting.append(("frame", self._slots, *about))
                case _:
                    self._waiting.append(message)

    def _make_room(self, size: int) -> None:
        """Shared memory for images of so many bytes; those of before stay until they are not used."""
        count = slots_for_all(size) if self._every else SLOTS
        self._slots = FrameSlots.make(size, count)
        self._say("memory", self._slots.name, size, count)
        while self._pipe.poll(_CLOSING + SILENT):
            try:
                message = self._pipe.recv()
            except (EOFError, OSError):
                raise self._lost() from None
            if message == ("attached",):
                break
            self._waiting.append(message)
        self._slots.forget()

    def _lost(self) -> SensorFault:
        """The process has ended."""
        self._process.join(_CLOSING)
        code = self._process.exitcode
        why = f"its driver crashed (signal {-code})" if code and code < 0 else "its driver ended"
        if code and code < 0 and (said := self._words.read()):
            keep_text(self._name, said, -code)
        return SensorFault(why, where=self._name, mend="It is started again by itself; see the log.")


def _error(
    said: tuple[str, str, str, str], name: str, kind: type[InputError] | type[ResourceError]
) -> InputError | ResourceError:
    """What a driver's error is to the edge: of its own kind where it was one of the two."""
    of, what, where, mend = said
    made = {"InputError": InputError, "ResourceError": kind}.get(of, kind)
    if kind is InputError:
        made = InputError
    return made(what, where=where or name, mend=mend)
