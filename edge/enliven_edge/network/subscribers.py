"""The subscribers of the streams: each has its topics and a bounded queue."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from enliven.wire import MAX_STREAM_BYTES, STREAMS, make_frame
from enliven_edge.network.server import ZmtpServer

if TYPE_CHECKING:
    from enliven.keys import CurveServer

_MAX_SUBSCRIPTION_BYTES = 64
"""Maximum bytes of a subscriber's frame: "SUBSCRIBE" and the name of a topic have 23."""
_MAX_PENDING_BYTES = 2 * MAX_STREAM_BYTES
"""Maximum bytes that wait for a subscriber, in addition to the system's buffer. More are dropped for that
one only."""
_READ_TIME_S = 0.00025
"""Time per poll for reading subscriptions, in seconds. Subscriptions are short and rare."""


class Subscribers:
    """Sends every message to the peers that subscribed to a prefix of its topic.

    Args and errors as for :class:`~enliven_edge.network.ZmtpServer`.
    """

    def __init__(self, host: str, port: int, option: str, curve: CurveServer | None = None) -> None:
        self._server = server = ZmtpServer(host, port, option, "PUB", _MAX_SUBSCRIPTION_BYTES, curve=curve)
        self.port, self.drain, self.close = server.port, server.drain, server.close

    @property
    def server(self) -> ZmtpServer:
        """The server with the connections."""
        return self._server

    def poll(self) -> None:
        """Accepts connections, reads subscriptions and sends queued bytes."""
        for peer, parts in self._server.messages(time.monotonic() + _READ_TIME_S):
            request = parts[0]
            # Ignore a prefix that matches no topic, so that it is not stored.
            if len(parts) == 1 and any((name.encode() + b"\0").startswith(request[1:]) for name in STREAMS):
                wanted: frozenset[bytes] = peer.state or frozenset()
                if request[:1] == b"\x01":
                    peer.state, peer.introduced = wanted | {request[1:]}, True
                elif request[:1] == b"\x00":
                    peer.state = wanted - {request[1:]}

    def send(self, data: bytes) -> None:
        """Sends a message, its topic first."""
        frame = make_frame(data)
        for peer in list(self._server.connections):
            wanted = peer.state
            if (
                wanted
                and data.startswith(tuple(wanted))
                and peer.unsent_bytes + len(frame) <= _MAX_PENDING_BYTES
            ):
                if peer.session.channel is None:
                    self._server.send_raw(peer, frame)
                else:
                    self._server.send(peer, data)
