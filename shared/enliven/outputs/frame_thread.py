"""The thread that sends the newest frame to all outputs, while another one receives the next frames."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

from enliven.outputs.live_frame import LiveEvent, LiveFrame
from enliven.outputs.sender import Sender
from enliven.supervision.closeable import Closeable

MAX_EVENTS = 256
"""Maximum number of events that wait for the next frame."""
_JOIN_TIMEOUT_S = 2.0
"""Seconds to wait for the thread at the end. It only sends, which takes less than a frame."""


class FrameThread(Closeable):
    """A thread that sends each frame to several outputs, one after another.

    One thread wakes up once for each frame. A thread for each output would take about a third more processor
    time to send a frame (measured), because each waits for the interpreter's lock again and again.

    :meth:`put` replaces the frame that waits. So a busy computer loses frames, and a frame that is sent is at
    most one frame old.

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
        """Hands over a frame. It returns at once."""
        with self._changed:
            if self._newest is not None:
                self.skipped += 1
            self._newest = frame
            self._events.extend(frame.events)
            self._changed.notify()

    def close(self) -> None:
        """Sends the frame that waits, and ends the thread. A second call does nothing."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join(_JOIN_TIMEOUT_S)

    def _run(self) -> None:
        while (frame := self._next()) is not None:
            for sender in self._senders:
                sender.send(frame)

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
