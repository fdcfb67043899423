"""The edge's side of a sensor in a helper process.

Frames are read from shared memory, and silence counts as a loss.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable
from typing import Any, cast

from enliven.errors import InputError, ResourceError
from enliven.frames import Frame
from enliven_edge.sensors.base import CHECK_IT, Condition, Sensor, SensorFault
from enliven_edge.sensors.isolation.helper_process import SILENCE_TIMEOUT_S, HelperProcess, error_from_helper

FIRST_IMAGE_TIMEOUT_S = 10.0
"""Maximum seconds until the first image. In this time firmware is loaded and exposure is adjusted."""


class IsolatedOpener:
    """Opens a sensor in a helper process, with a new process for each device.

    Thus a library's state does not outlive its device. If several devices match the options, the same one is
    opened again, with the options in the driver's attribute ``again``.

    Args:
        name: name of the sensor, for errors before it is open.
        kind: the sensor's class, at the top of a module that the helper process can import.
        options: arguments of the class.
        every_frame: whether images wait for a slow reader, up to the memory limit. If False, the oldest are
            dropped.
    """

    def __init__(
        self, name: str, kind: Callable[..., Sensor], options: dict[str, Any], every_frame: bool = False
    ) -> None:
        self._start = functools.partial(HelperProcess, name, kind, every_frame=every_frame)
        self._options = options
        self._idle: HelperProcess | None = None
        self._reuses_process = False

    def reuse_process(self) -> None:
        """Makes later failing attempts share one process, which :meth:`close` ends."""
        self._reuses_process = True

    def __call__(self) -> IsolatedSensor:
        """Opens the sensor.

        Raises:
            InputError: for options that cannot be used.
            ResourceError: if the device is missing or in use, or the library crashes.
        """
        helper, self._idle = self._idle or self._start(self._options), None
        try:
            name, fps, reopens = helper.open()
        except (InputError, ResourceError):
            if self._reuses_process and helper.is_alive:
                self._idle = helper
            else:
                helper.end()
            raise
        self._options = {**self._options, **reopens}
        return IsolatedSensor(helper, name, fps)

    def close(self) -> None:
        """Ends the process of failed attempts."""
        helper, self._idle = self._idle, None
        if helper is not None:
            helper.end()


class IsolatedSensor(Sensor):
    """A :class:`~enliven_edge.sensors.base.Sensor` with its driver in a helper process.

    Its frames are read-only in shared memory, and stay unchanged while they are referenced.

    Args:
        helper: a process with the opened device.
        name, fps: as the driver reports them.
    """

    def __init__(self, helper: HelperProcess, name: str, fps: float | None) -> None:
        self._helper, self.name, self.fps = helper, name, fps
        self._condition: Condition | None = None
        self._last_image_at, self._patience = -math.inf, FIRST_IMAGE_TIMEOUT_S
        self._closed = False

    def condition(self) -> Condition | None:
        """Returns the last reported condition of the device."""
        return self._condition

    def read(self, timeout: float | None = None) -> Frame | None:
        """Returns the next frame of the helper process. The first call starts its frames.

        Returns None after the end of the stream.

        Raises:
            TimeoutError: if no frame arrived in time.
            SensorFault: if the device counts as lost, because no frame arrived for a long time.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        if self._last_image_at == -math.inf and not self._closed:
            self._helper.start_frames()
            self._last_image_at = time.monotonic()
        while not self._closed:
            left = self._last_image_at + self._patience - time.monotonic()
            wait = left if deadline is None else min(left, deadline - time.monotonic())
            message = self._helper.receive(max(wait, 0.0))
            if message is None:
                if time.monotonic() >= self._last_image_at + self._patience:
                    why = f"no image arrived for {self._patience:.0f} s"
                    raise SensorFault(why, where=self.name, remedy=CHECK_IT)
                raise TimeoutError(f"no image of {self.name} yet")
            frame = self._frame_from_message(*message)
            if frame is not None:
                return frame
        return None

    def close(self) -> None:
        """Ends the helper process, and kills it if its driver hangs. A second call does nothing."""
        if not self._closed:
            self._closed = True
            self._helper.end()

    def _frame_from_message(self, word: str, *rest: Any) -> Frame | None:
        """Returns the frame in a message, or None for a message without a frame."""
        match word:
            case "frame":
                self._last_image_at, self._patience = time.monotonic(), SILENCE_TIMEOUT_S
                return self._helper.frame(*rest)
            case "bodies":
                self._last_image_at, self._patience = time.monotonic(), SILENCE_TIMEOUT_S
                (bodies,) = rest
                return cast(Frame, bodies)
            case "condition":
                (self._condition,) = rest
            case "bad":
                self._last_image_at = time.monotonic()
                raise error_from_helper(rest, self.name, InputError)
            case "lost":
                raise error_from_helper(rest, self.name, SensorFault)
            case "end":
                self.close()
        return None
