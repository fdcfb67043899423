"""Reads a sensor in a thread of its own until it ends, fails, or is stopped."""

from __future__ import annotations

import logging
import threading
from abc import ABC, abstractmethod

from enliven_edge.sensors import Sensor

log = logging.getLogger(__name__)

PATIENCE = 0.1
"""Seconds to wait for a frame before checking whether to stop."""


class SensorThread(ABC):
    """Runs :meth:`_read` for one sensor; a failure is kept for the user, and the other sensors go on.

    Args:
        name: the sensor's identity.

    Attributes:
        ended: no more frames will come.
        failure: the reason, where it was no ordinary end.
        recorded: whether it is a recording: its frames may wait for those of others.
    """

    def __init__(self, name: str, sensor: Sensor) -> None:
        self.name, self.sensor = name, sensor
        self.ended, self.failure = False, ""
        self.recorded = bool(getattr(sensor, "recorded", False))
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"sensor {name}", daemon=True)

    def start(self) -> None:
        """Begins to read."""
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join(timeout=5.0)

    def _run(self) -> None:
        try:
            self._read()
        except Exception as error:
            self.failure = str(error) or type(error).__name__
            log.debug("sensor %s failed", self.name, exc_info=True)
        self._end()

    @abstractmethod
    def _read(self) -> None:
        """Reads until the end, or until :attr:`_stopped` is set."""

    def _end(self) -> None:
        """Marks the end of the frames."""
        self.ended = True
