"""Those whom the streams go to, each with what it subscribed to and a short queue."""

from __future__ import annotations

import time

from enliven.wire.topics import MAX_STREAM_BYTES, STREAMS
from enliven.wire.zmtp import framed
from enliven_edge.doors import Door

_MOST_SUBSCRIPTION = 64
"""Bytes of a frame that a subscriber sends: "SUBSCRIBE" and the name of a topic are 23."""
_MOST_OWED = 2 * MAX_STREAM_BYTES
"""Bytes that wait for a subscriber beside what the system holds; more are dropped for that one alone."""
_READING = 0.00025
"""Seconds a poll for reading subscriptions."""
_NAMES = tuple(name.encode() + b"\0" for name in STREAMS)


class Subscribers:
    """A door that sends every message to those who subscribed to the beginning of its topic.

    Args and errors as for :class:`~enliven_edge.doors.Door`.
    """

    def __init__(self, host: str, port: int, option: str) -> None:
        self._door = Door(host, port, option, "PUB", _MOST_SUBSCRIPTION)
        self.port, self.drain, self.close = self._door.port, self._door.drain, self._door.close

    def poll(self) -> None:
        """Lets newcomers in, and sends what waits."""
        for peer, parts in self._door.messages(time.monotonic() + _READING):
            said = parts[0]
            # A beginning that no topic has matches nothing, and is not kept.
            if len(parts) == 1 and any(name.startswith(said[1:]) for name in _NAMES):
                wanted: frozenset[bytes] = peer.guest or frozenset()
                if said[:1] == b"\x01":
                    peer.guest, peer.met = wanted | {said[1:]}, True
                elif said[:1] == b"\x00":
                    peer.guest = wanted - {said[1:]}

    def send(self, data: bytes) -> None:
        """A message, its topic first."""
        frame = framed(data)
        for peer in list(self._door.connections):
            wanted = peer.guest
            if wanted and data.startswith(tuple(wanted)) and peer.owed + len(frame) <= _MOST_OWED:
                self._door.send_raw(peer, frame)
