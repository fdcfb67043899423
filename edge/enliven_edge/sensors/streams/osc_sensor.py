"""The common part of sensors that receive motion as OSC messages over UDP."""

from __future__ import annotations

import time
from abc import abstractmethod

from enliven.frames import BodyFrame
from enliven.person import Body
from enliven_edge.extras import need
from enliven_edge.sensors.base import Sensor

MAX_METRES = 1000.0
"""Positions farther away than this are refused, in metres."""
_MIN_WAIT_S = 1e-3
"""Shortest wait for a packet, in seconds. A wait of 0 would mean not to wait at all."""


class OscSensor(Sensor):
    """Listens on a UDP port, and delivers a frame of bodies for each set of messages that contains motion.

    Args:
        kind: the name of the sensor on the command line.
        items: the expected data, for error messages: "bones".
        port: UDP port to listen on.
        host: address to listen on. "0.0.0.0" also accepts other machines.

    Raises:
        InputError: for a wrong port.
        ResourceError: for a port in use, or if python-osc is missing.
    """

    made_up = True

    def __init__(self, kind: str, items: str, port: int, host: str) -> None:
        need("pythonosc", "outputs", kind)
        from enliven_edge.sensors.streams.osc_port import OscPort

        self._port = OscPort(host, port, f"sensor {kind}")
        self.port = self._port.port
        self.name = f"{kind} {self.port}"
        self._missing = f"no {items} came to {self.name}"
        self._closed = False

    def read(self, timeout: float | None = None) -> BodyFrame | None:
        """Returns the next frame. Args, return value and errors as for every sensor."""
        if self._closed:
            return None
        end = None if timeout is None else time.monotonic() + timeout
        while True:
            try:
                messages = self._port.frame(None if end is None else max(end - time.monotonic(), _MIN_WAIT_S))
            except TimeoutError:
                raise TimeoutError(self._missing) from None
            if self._take(messages):
                return BodyFrame(self._bodies(), time.monotonic_ns(), self.name)
            if end is not None and time.monotonic() >= end:
                raise TimeoutError(self._missing)

    def close(self) -> None:
        """Frees the port."""
        self._closed = True
        self._port.close()

    @abstractmethod
    def _take(self, messages: list[tuple[str, list[object]]]) -> bool:
        """Keeps the motion of a set of messages. Returns True if it contained some."""

    @abstractmethod
    def _bodies(self) -> list[Body]:
        """Returns the bodies of the kept motion."""
