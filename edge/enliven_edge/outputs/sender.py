"""Sends the packets of one output from a thread of its own, so that the edge never waits for it."""

from __future__ import annotations

import logging
import socket
import threading
import time
from collections import deque
from dataclasses import replace

from enliven_edge.closeable import Closeable
from enliven_edge.outputs.address import Place
from enliven_edge.outputs.live_frame import LiveEvent, LiveFrame
from enliven_edge.outputs.output import LiveOutput

log = logging.getLogger(__name__)

_BUFFER_BYTES = 1 << 18
"""Size of the system's send buffer: some frames of the largest output."""
_MAX_EVENTS = 256
"""Maximum number of events that wait for the next packet."""
_MAX_LOG_INTERVAL_S = 60.0
"""Seconds between two log messages about the same failing output."""
_CLEAR_AFTER_S = 3.0
"""Seconds without an error after which an output counts as working again."""
_JOIN_TIMEOUT_S = 2.0
"""Seconds to wait for the thread at the end. It only sends packets, which takes less than a frame."""


class Sender(Closeable):
    """One output with its socket and its thread.

    :meth:`put` replaces the frame that waits. So a slow receiver or a busy computer loses frames, and a frame
    that is sent is at most one frame old.

    Args:
        name: of the output, for messages.
        output: turns frames into packets.
        family, place: of the receiver, see :func:`enliven_edge.outputs.address.resolve`.

    Attributes:
        sent: number of packets that were sent.
        errors: number of packets that were not sent.
        skipped: number of frames that were replaced before they were sent.
    """

    def __init__(self, name: str, output: LiveOutput, family: socket.AddressFamily, place: Place) -> None:
        self.name = name
        self.sent = self.errors = self.skipped = 0
        self._output = output
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
        self._place = place
        self._is_connected = False
        self._reason, self._failed_at, self._logged_at = "", -_CLEAR_AFTER_S, -_MAX_LOG_INTERVAL_S
        self._changed = threading.Condition()
        self._newest: LiveFrame | None = None
        self._events: deque[LiveEvent] = deque(maxlen=_MAX_EVENTS)
        self._ended = False
        self._thread = threading.Thread(target=self._run, name=f"output {name}", daemon=True)
        self._thread.start()

    @property
    def trouble(self) -> str:
        """Why packets are lost now. Empty if the output works."""
        return self._reason if time.monotonic() - self._failed_at < _CLEAR_AFTER_S else ""

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
        self._socket.close()

    def _run(self) -> None:
        while (frame := self._next()) is not None:
            try:
                packets = self._output.packets(frame)
            except Exception as error:
                # A fault of one output must end neither its thread nor the edge.
                log.debug("output %s", self.name, exc_info=True)
                self._fail(f"the frame could not be converted ({error})")
                continue
            for packet in packets:
                self._send(packet)

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

    def _send(self, packet: bytes) -> None:
        """Sends one packet, or counts it as lost. It never blocks."""
        try:
            if not self._is_connected:
                # A connected socket reports when nothing listens at the receiver's port.
                self._socket.connect(self._place)
                self._is_connected = True
            try:
                self._socket.send(packet)
            except ConnectionRefusedError:
                # This is the answer to an earlier packet. The receiver may have started since.
                self._fail("no program listens there")
                self._socket.send(packet)
        except ConnectionRefusedError:
            pass
        except BlockingIOError:
            self._fail("the network takes fewer packets than are sent")
        except OSError as error:
            self._is_connected = False
            self._fail(error.strerror or str(error))
        else:
            self.sent += 1

    def _fail(self, reason: str) -> None:
        """Counts a lost packet, and logs the reason with a rate limit."""
        self.errors += 1
        now = time.monotonic()
        self._reason, self._failed_at = reason, now
        if now - self._logged_at >= _MAX_LOG_INTERVAL_S:
            self._logged_at = now
            log.warning("output %s: %s. Lost packets: %d.", self.name, reason, self.errors)
