"""The base class of open outputs. It counts sent and lost packets."""

from __future__ import annotations

import logging
import time
from abc import abstractmethod
from collections.abc import Sequence

from enliven.health import HealthState
from enliven.outputs.live_frame import LiveFrame
from enliven.supervision.closeable import Closeable

log = logging.getLogger(__name__)

_MAX_LOG_INTERVAL_S = 60.0
"""Minimum interval in seconds between two log messages about the same failing output."""
_CLEAR_AFTER_S = 3.0
"""Time in seconds without an error after which an output counts as working again."""


class Sender(Closeable):
    """One open output with its connection.

    Args:
        name: name of the output, for messages.

    Attributes:
        sent: number of packets or messages that were sent.
        errors: number of packets or frames that were not sent.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.sent = self.errors = 0
        self._reason, self._failed_at, self._logged_at = "", -_CLEAR_AFTER_S, -_MAX_LOG_INTERVAL_S

    @property
    def trouble(self) -> str:
        """The reason why frames are being lost. Empty if the output works."""
        return self._reason if time.monotonic() - self._failed_at < _CLEAR_AFTER_S else ""

    @property
    def wants_depth(self) -> bool:
        """True if the output currently sends depth images. Most outputs never send them."""
        return False

    def send(self, frame: LiveFrame) -> None:
        """Sends one frame without blocking. A failure is counted and not raised.

        Call it from one thread only.
        """
        try:
            self._send(frame)
        except Exception as error:
            # An exception in one output must not stop the other outputs or the edge.
            log.debug("output %s", self.name, exc_info=True)
            self._fail(f"the frame could not be converted ({error})")

    def put_health(self, states: Sequence[HealthState]) -> None:
        """Sends the edge's health states. They may arrive without a frame. Most outputs ignore them."""

    @abstractmethod
    def close(self) -> None:
        """Closes the connection. A second call does nothing."""

    @abstractmethod
    def _send(self, frame: LiveFrame) -> None:
        """Sends one frame without blocking."""

    def _fail(self, reason: str) -> None:
        """Counts a loss, and logs the reason with a rate limit."""
        self.errors += 1
        now = time.monotonic()
        self._reason, self._failed_at = reason, now
        if now - self._logged_at >= _MAX_LOG_INTERVAL_S:
            self._logged_at = now
            log.warning("live output %s: %s. Lost packets: %d.", self.name, reason, self.errors)
