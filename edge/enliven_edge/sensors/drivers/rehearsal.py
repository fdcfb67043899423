"""The images of a recording in place of a device: a driver takes them in through its own library."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven_edge.sensors.replay import ReplaySensor

log = logging.getLogger(__name__)

_TURN = 0.1
"""Seconds between two looks at whether the rehearsal is over."""


class Rehearsal:
    """Plays a recording of a depth camera on a thread of its own, at its pace.

    Args:
        path: the recording.
        send: takes each of its images, on that thread.
        loop: begin again at the end.

    Attributes:
        first: its first image, which says what the device would say of its camera.
        fps: images a second.

    Raises:
        InputError: where it is no recording, or none of a depth camera.
    """

    def __init__(self, path: str, send: Callable[[DepthFrame, int], None], loop: bool = False) -> None:
        with ReplaySensor(path, speed=0.0) as look:
            first = look.read()
        if not isinstance(first, DepthFrame):
            raise InputError("it holds no depth images", where=path, mend="Rehearse with a depth recording.")
        self.first = first
        self._over = threading.Event()
        self._sensor, self._send = ReplaySensor(path, loop=loop), send
        self.fps = self._sensor.fps or 30.0
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._play, name=f"rehearsal {path}", daemon=True)

    def is_over(self) -> bool:
        """Whether the last image was sent; the first call begins to send, so that none is late."""
        if self._thread.ident is None:
            self._thread.start()
        return self._over.is_set()

    def stop(self) -> None:
        """Ends it."""
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
            except InputError as error:
                log.warning("%s", error)
                continue
            if frame is None:
                break
            if isinstance(frame, DepthFrame):
                self._send(frame, number)
                number += 1
        self._over.set()
