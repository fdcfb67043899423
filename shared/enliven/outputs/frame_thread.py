"""A thread that sends the newest frame to all outputs, while the calling thread receives the next frames."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

from enliven.outputs.live_frame import LiveEvent, LiveFrame
from enliven.outputs.sender import Sender
from enliven.supervision.closeable import Closeable

MAX_EVENTS = 256
"""Maximum number of events that are queued until the next frame is sent."""
_JOIN_TIMEOUT_S = 2.0
"""Maximum time in seconds to wait for the thread's end. Sending a frame takes far less."""


class FrameThread(Closeable):
    """A thread that sends each frame to several outputs in sequence.

    A single thread wakes up once per frame. One thread per output would take about a third more processor
    time per frame (measured), because the threads would compete for Python's global lock.

    :meth:`put` replaces a frame that has not been sent yet. So a busy computer skips frames, and a frame is
    at most one frame old when it is sent.

    Args:
        senders: the outputs. The thread does not close them.

    Attributes:
        skipped: number of frames that were replaced before they were sent.
    """

    def __init__(self, senders: Sequence[Sender]) -> None:
        self.skipped = 0
        self._senders = tuple(senders)
        self._changed = threading.Condition()
        self._newest: LiveFrame | None = None
        self._events: deque[LiveEvent] = deque(maxlen=MAX_EVENTS)
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="live outputs", daemon=True)
        self._thread.start()

    def put(self, frame: LiveFrame) -> None:
        """Passes a frame to the thread. Returns immediately."""
        with self._changed:
            if self._newest is not None:
                self.skipped += 1
            self._newest = frame
            self._events.extend(frame.events)
            self._changed.notify()

    def close(self) -> None:
        """Sends the last frame if it has not been sent yet, and ends the thread. A second call does
        nothing."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join(_JOIN_TIMEOUT_S)

    def _run(self) -> None:
        while (frame := self._next()) is not None:
            for sender in self._senders:
                sender.send(frame)

    def _next(self) -> LiveFrame | None:
        """Waits for the next frame, and returns it with all events since the last sent frame. Returns None
        when the thread must end."""
        with self._changed:
            self._changed.wait_for(lambda: self._ended or self._newest is not None)
            frame, self._newest = self._newest, None
            events = tuple(self._events)
            self._events.clear()
        if frame is None or len(events) == len(frame.events):
            return frame
        return replace(frame, events=events)
