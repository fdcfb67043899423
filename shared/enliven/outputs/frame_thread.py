"""A thread that hands the newest frame to one output, so that the edge never waits for it."""

from __future__ import annotations

import logging
import threading
import time
from abc import abstractmethod
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace

from enliven.health import HealthState
from enliven.outputs.live_frame import CharacterInfo, LiveEvent, LiveFrame
from enliven.supervision.closeable import Closeable

log = logging.getLogger(__name__)

_MAX_EVENTS = 256
"""Maximum number of events that wait for the next frame."""
_MAX_LOG_INTERVAL_S = 60.0
"""Seconds between two log messages about the same failing output."""
_CLEAR_AFTER_S = 3.0
"""Seconds without an error after which an output counts as working again."""
_JOIN_TIMEOUT_S = 2.0
"""Seconds to wait for the thread at the end. It only sends, which takes less than a frame."""


class FrameThread(Closeable):
    """One output with its thread.

    :meth:`put` replaces the frame that waits. So a slow receiver or a busy computer loses frames, and a frame
    that is sent is at most one frame old.

    Args:
        name: of the output, for messages.

    Attributes:
        sent: number of packets or messages that were sent.
        errors: number of packets or frames that were not sent.
        skipped: number of frames that were replaced before they were sent.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.sent = self.errors = self.skipped = 0
        self._reason, self._failed_at, self._logged_at = "", -_CLEAR_AFTER_S, -_MAX_LOG_INTERVAL_S
        self._changed = threading.Condition()
        self._newest: LiveFrame | None = None
        self._events: deque[LiveEvent] = deque(maxlen=_MAX_EVENTS)
        self._ended = False
        self._thread = threading.Thread(target=self._run, name=f"output {name}", daemon=True)

    @property
    def trouble(self) -> str:
        """Why frames are lost now. Empty if the output works."""
        return self._reason if time.monotonic() - self._failed_at < _CLEAR_AFTER_S else ""

    def check(self, characters: Mapping[str, CharacterInfo]) -> None:
        """Checks the characters that are on the stage at the start. Most outputs send any character.

        Raises:
            InputError: if the output cannot send the character that its address names.
        """

    def _start(self) -> None:
        """Starts the thread. A subclass calls it when its connection is open."""
        self._thread.start()

    def put(self, frame: LiveFrame) -> None:
        """Hands over a frame. It returns at once."""
        with self._changed:
            if self._newest is not None:
                self.skipped += 1
            self._newest = frame
            self._events.extend(frame.events)
            self._changed.notify()

    def put_health(self, states: Sequence[HealthState]) -> None:
        """Hands over the edge's health states, even without frames. Most outputs ignore them."""

    def close(self) -> None:
        """Sends the frame that waits, and ends the thread. A second call does nothing."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(_JOIN_TIMEOUT_S)
        self._disconnect()

    @abstractmethod
    def _send(self, frame: LiveFrame) -> None:
        """Sends one frame without blocking. Runs in the thread."""

    @abstractmethod
    def _disconnect(self) -> None:
        """Frees the connection. A second call does nothing."""

    def _run(self) -> None:
        while (frame := self._next()) is not None:
            try:
                self._send(frame)
            except Exception as error:
                # A fault of one output must end neither its thread nor the edge.
                log.debug("output %s", self.name, exc_info=True)
                self._fail(f"the frame could not be converted ({error})")

    def _next(self) -> LiveFrame | None:
        """Waits for the next frame, and returns it with all events since the last one. None: the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._ended or self._newest is not None)
            frame, self._newest = self._newest, None
            events = tuple(self._events)
            self._events.clear()
        if frame is None or len(events) == len(frame.events):
            return frame
        return replace(frame, events=events)

    def _fail(self, reason: str) -> None:
        """Counts a loss, and logs the reason with a rate limit."""
        self.errors += 1
        now = time.monotonic()
        self._reason, self._failed_at = reason, now
        if now - self._logged_at >= _MAX_LOG_INTERVAL_S:
            self._logged_at = now
            log.warning("output %s: %s. Lost packets: %d.", self.name, reason, self.errors)
