"""Rehearsal: a recording's images in place of a device, which a driver reads through its own library."""

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

_TURN = 0.1
"""Seconds between two looks at whether the rehearsal is over."""
WAITING = 4
"""Images that may wait in a library: more are not handed to it before the driver has taken one."""
_HEAD_START = 0.002
"""Seconds that the driver has for an image before the next is decoded: a device decodes none here."""
_LONGEST_PAUSE = 0.5
"""Seconds of silence at most: after one second a driver would be taken for lost, and begin anew for ever."""
_GRACE = 0.5
"""Seconds in which the last images come through a library, on a loaded machine too."""
_CLOCK_NS = 2_000
"""Nanoseconds by which a library's clock may round; a camera's step is some thousand times as long."""
_MOST_COUNTED = 1 << 31
"""Images that every library can count."""


class Rehearsal:
    """Plays a recording of a depth camera on a thread of its own, at its pace.

    Args:
        path: the recording.
        send: takes each of its images and its number, as recorded where it was, on that thread.
        loop: begin again at the end.
        paced: no image is lost where the driver is slower: it says which it has :meth:`taken`, and more than
            :data:`WAITING` never wait.

    Attributes:
        first: its first image, which says what the device would say of its camera.
        fps: images a second.

    Raises:
        InputError: where it is no recording, or none of a depth camera.
    """

    def __init__(
        self, path: str, send: Callable[[DepthFrame, int], None], loop: bool = False, paced: bool = False
    ) -> None:
        first = _first(path)
        if not isinstance(first, DepthFrame):
            raise InputError("it holds no depth images", where=path, mend="Rehearse with a depth recording.")
        self.first = first
        self._over, self._ended = threading.Event(), 0.0
        self._sensor = ReplaySensor(path, loop=loop, longest_pause=_LONGEST_PAUSE)
        self._send, self._room = send, threading.Semaphore(WAITING)
        self._paced, self._sent = paced, deque[int]()
        self.fps = self._sensor.fps or 30.0
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._play, name=f"rehearsal {path}", daemon=True)

    def is_over(self) -> bool:
        """Whether the last image has come through; the first call begins to send, so that none is late."""
        if self._thread.ident is None:
            self._thread.start()
        return self._over.is_set() and (not self._sent or time.monotonic() > self._ended + _GRACE)

    def taken(self, time_ns: int) -> int:
        """Notes that the driver has taken the images up to this time out of its library.

        Returns:
            the time of the image as it was recorded: a library may count in microseconds.
        """
        while self._sent and self._sent[0] <= time_ns + _CLOCK_NS:
            sent = self._sent.popleft()
            self._room.release()
            if sent >= time_ns - _CLOCK_NS:
                return sent
        return time_ns

    def condition(self) -> Condition | None:
        """The condition of the recorded device; None where it was not recorded."""
        return self._sensor.condition()

    def stop(self) -> None:
        """Stops the rehearsal."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join(2 * _TURN)
        self._sensor.close()

    def _play(self) -> None:
        number = 0
        while not self._stopped.is_set():
            try:
                frame = self._sensor.read(_TURN)
            except TimeoutError:
                continue
            except (InputError, SensorFault) as error:
                log.warning("%s", error)
                continue
            if frame is None:
                break
            if isinstance(frame, DepthFrame) and self._has_room():
                told = frame.sequence
                if self._paced:
                    self._sent.append(frame.time_ns)
                self._send(frame, told if told is not None and 0 <= told < _MOST_COUNTED else number)
                number += 1
                time.sleep(_HEAD_START)
        self._ended = time.monotonic()
        self._over.set()

    def _has_room(self) -> bool:
        """Waits until the library has room for an image; False where the rehearsal was stopped before."""
        while not self._stopped.is_set():
            if not self._paced or self._room.acquire(timeout=_TURN):
                return True
        return False


def _first(path: str) -> Frame | None:
    """The first frame of a recording, after what may have gone wrong before it."""
    with ReplaySensor(path, speed=0.0) as look:
        while True:
            with contextlib.suppress(InputError, SensorFault):
                return look.read()
