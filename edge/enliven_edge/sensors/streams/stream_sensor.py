"""The base class of sensors that receive the motion of another program over UDP."""

from __future__ import annotations

import time
from abc import abstractmethod
from typing import Generic, Protocol, TypeVar

from enliven.frames import BodyFrame
from enliven.person import Body
from enliven.supervision.closeable import Closeable
from enliven_edge.sensors.base import Sensor

MAX_METRES = 1000.0
"""Maximum distance of a position from the origin in metres. Positions farther away are rejected."""
_MIN_WAIT_S = 1e-3
"""Minimum time in seconds to wait for a packet. With 0, the socket would not wait at all."""


Message = tuple[str, list[object]]
"""An OSC address and its arguments."""
Data = TypeVar("Data")
"""The content of the packets of one frame, such as a list of OSC messages."""
DataOfPort = TypeVar("DataOfPort", covariant=True)


class FramePort(Closeable, Protocol[DataOfPort]):
    """A UDP port that collects the packets of one frame."""

    port: int

    def frame(self, timeout: float | None) -> DataOfPort:
        """Returns the content of the next frame.

        Raises:
            TimeoutError: if nothing arrived in time.
        """
        ...


class StreamSensor(Sensor, Generic[Data]):
    """Listens on a UDP port, and delivers a frame of bodies for each frame of packets that contains motion.

    Args:
        kind: the name of the sensor on the command line.
        items: the name of the expected data in error messages, such as "bones".
        port: the port, which this sensor closes.
    """

    made_up = True
    may_be_silent = True

    def __init__(self, kind: str, items: str, port: FramePort[Data]) -> None:
        self._port = port
        self.port = port.port
        self.name = f"{kind} {self.port}"
        self._missing = f"no {items} arrived at {self.name}"
        self._closed = False

    def read(self, timeout: float | None = None) -> BodyFrame | None:
        """Returns the next frame. See :meth:`Sensor.read`."""
        if self._closed:
            return None
        end = None if timeout is None else time.monotonic() + timeout
        while True:
            try:
                data = self._port.frame(None if end is None else max(end - time.monotonic(), _MIN_WAIT_S))
            except TimeoutError:
                raise TimeoutError(self._missing) from None
            if self._store_motion(data):
                return BodyFrame(self._bodies(), time.monotonic_ns(), self.name)
            if end is not None and time.monotonic() >= end:
                raise TimeoutError(self._missing)

    def close(self) -> None:
        """Releases the port."""
        self._closed = True
        self._port.close()

    @abstractmethod
    def _store_motion(self, data: Data) -> bool:
        """Stores the motion in a frame of packets. Returns True if the frame contained motion."""

    @abstractmethod
    def _bodies(self) -> list[Body]:
        """Returns the bodies of the stored motion."""
