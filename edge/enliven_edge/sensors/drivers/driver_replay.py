"""Driver replay: a driver reads the images of a recording, instead of those of a device, through its own
library.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections import deque
from collections.abc import Callable

from enliven.errors import InputError
from enliven.frames import DepthFrame, Frame
from enliven_edge.sensors.base import Condition, SensorFault
from enliven_edge.sensors.replay import ReplaySensor

log = logging.getLogger(__name__)

_POLL_INTERVAL_S = 0.1
"""Seconds between two checks whether the rehearsal has ended."""
MAX_WAITING_IMAGES = 4
"""Maximum number of images waiting in a library. The next image is sent after the driver has taken one."""
_DRIVER_TIME_S = 0.002
"""Seconds that the driver gets for an image before the next one is decoded. A real device needs no decoding
on this machine."""
_MAX_PAUSE_S = 0.5
"""Maximum seconds without an image. After one second a driver would count as lost, and restart endlessly."""
_DRAIN_TIME_S = 0.5
"""Seconds in which the last images pass through a library, even on a busy machine."""
_CLOCK_NS = 2_000
"""Rounding error of a library's clock in nanoseconds. A frame interval is several thousand times longer."""
_MAX_FRAME_NUMBER = 1 << 31
"""An image number that every library can represent."""


class DriverReplay:
    """Plays a recording of a depth camera on a separate thread, at its recorded pace.

    Args:
        path: the recording.
        send: called on that thread with each image and its number. The number is the recorded one if there is
            one.
        loop: whether to start again at the end.
        paced: whether to lose no image if the driver is slow. The driver reports each image that it has taken
            by :meth:`record_taken`, and at most :data:`MAX_WAITING_IMAGES` images wait.

    Attributes:
        first: the first image, which contains the camera's properties.
        fps: images per second.

    Raises:
        InputError: if it is not a recording, or has no depth camera.
    """

    def __init__(
        self, path: str, send: Callable[[DepthFrame, int], None], loop: bool = False, paced: bool = False
    ) -> None:
        first = _read_first(path)
        if not isinstance(first, DepthFrame):
            raise InputError(
                "the recording contains no depth images",
                where=path,
                remedy="Rehearse with a depth recording.",
            )
        self.first = first
        self._over, self._ended = threading.Event(), 0.0
        self._sensor = ReplaySensor(path, loop=loop, longest_pause=_MAX_PAUSE_S)
        self._send, self._room = send, threading.Semaphore(MAX_WAITING_IMAGES)
        self._paced, self._sent = paced, deque[int]()
        self.fps = self._sensor.fps or 30.0
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._play, name=f"rehearsal {path}", daemon=True)

    def is_over(self) -> bool:
        """Returns True after the last image has passed.

        The first call starts the playback, so that no image is lost.
        """
        if self._thread.ident is None:
            self._thread.start()
        return self._over.is_set() and (not self._sent or time.monotonic() > self._ended + _DRAIN_TIME_S)

    def record_taken(self, time_ns: int) -> int:
        """Records that the driver has taken the images up to this time out of its library.

        Returns:
            the recorded time of the image in nanoseconds. It may differ from ``time_ns``, because a library
            may count in microseconds.
        """
        while self._sent and self._sent[0] <= time_ns + _CLOCK_NS:
            sent = self._sent.popleft()
            self._room.release()
            if sent >= time_ns - _CLOCK_NS:
                return sent
        return time_ns

    def condition(self) -> Condition | None:
        """Returns the condition of the recorded device, or None if it was not recorded."""
        return self._sensor.condition()

    def stop(self) -> None:
        """Stops the rehearsal."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join(2 * _POLL_INTERVAL_S)
        self._sensor.close()

    def _play(self) -> None:
        number = 0
        while not self._stopped.is_set():
            try:
                frame = self._sensor.read(_POLL_INTERVAL_S)
            except TimeoutError:
                continue
            except (InputError, SensorFault) as error:
                log.warning("%s", error)
                continue
            if frame is None:
                break
            if isinstance(frame, DepthFrame) and self._has_room():
                sequence = frame.sequence
                if self._paced:
                    self._sent.append(frame.time_ns)
                self._send(
                    frame, sequence if sequence is not None and 0 <= sequence < _MAX_FRAME_NUMBER else number
                )
                number += 1
                time.sleep(_DRIVER_TIME_S)
        self._ended = time.monotonic()
        self._over.set()

    def _has_room(self) -> bool:
        """Waits until the library has room for an image.

        Returns False if the rehearsal was stopped before.
        """
        while not self._stopped.is_set():
            if not self._paced or self._room.acquire(timeout=_POLL_INTERVAL_S):
                return True
        return False


def _read_first(path: str) -> Frame | None:
    """Returns the first frame of a recording, skipping errors before it."""
    with ReplaySensor(path, speed=0.0) as look:
        while True:
            with contextlib.suppress(InputError, SensorFault):
                return look.read()
