"""The subscribers of the streams: each has its topics and a bounded queue."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from enliven.wire import MAX_STREAM_BYTES, STREAMS, make_frame
from enliven_edge.network.server import MAX_CONNECTIONS, ZmtpServer

if TYPE_CHECKING:
    from enliven.keys.curve import CurveServer

_MAX_SUBSCRIPTION_BYTES = 64
"""Maximum bytes of a subscriber's frame. "SUBSCRIBE" and the name of a topic together have 23 bytes."""
_MAX_PENDING_BYTES = 2 * MAX_STREAM_BYTES
"""Maximum bytes that are queued for a subscriber, in addition to the system's buffer. Further messages are
dropped for this subscriber only."""
_READ_TIME_S = 0.00025
"""Seconds per poll for reading subscriptions. Little is enough, because subscriptions are short and rare."""


class Subscribers:
    """Sends every message to the peers that subscribed to a prefix of its topic.

    Arguments and errors are those of :class:`~enliven_edge.network.server.ZmtpServer`.
    """

    def __init__(
        self,
        host: str,
        port: int,
        option: str,
        curve: CurveServer | None = None,
        max_connections: int = MAX_CONNECTIONS,
    ) -> None:
        self._server = server = ZmtpServer(
            host, port, option, "PUB", _MAX_SUBSCRIPTION_BYTES, max_connections, curve
        )
        self.port, self.drain, self.close = server.port, server.drain, server.close

    @property
    def server(self) -> ZmtpServer:
        """Returns the server with the connections."""
        return self._server

    def poll(self) -> None:
        """Accepts connections, reads subscriptions and sends queued bytes."""
        for peer, parts in self._server.messages(time.monotonic() + _READ_TIME_S):
            request = parts[0]
            # Ignore a prefix that matches no topic, so that unknown prefixes use no memory.
            if len(parts) == 1 and any((name.encode() + b"\0").startswith(request[1:]) for name in STREAMS):
                prefixes: frozenset[bytes] = peer.state or frozenset()
                if request[:1] == b"\x01":
                    peer.state, peer.introduced = prefixes | {request[1:]}, True
                elif request[:1] == b"\x00":
                    peer.state = prefixes - {request[1:]}

    def send(self, data: bytes) -> None:
        """Sends a message that starts with its topic."""
        self.send_all((data,))

    def send_all(self, messages: Sequence[bytes]) -> None:
        """Sends several messages. All messages to a peer are sent in one system call.

        With hundreds of peers, most of the time is spent on system calls, not on the number of bytes.
        """
        batch, size = list[bytes](), 0
        for data in messages:
            if batch and size + len(data) > MAX_STREAM_BYTES:
                self._send_batch(batch)
                batch, size = [], 0
            batch.append(data)
            size += len(data)
        self._send_batch(batch)

    def _send_batch(self, messages: Sequence[bytes]) -> None:
        """Sends messages that fit into a peer's queue together."""
        batches: dict[frozenset[bytes], tuple[bytes, list[bytes]]] = {}
        for peer in list(self._server.connections):
            subscribed: frozenset[bytes] | None = peer.state
            if not subscribed:
                continue
            if subscribed not in batches:
                prefixes = tuple(subscribed)
                matching = [data for data in messages if data.startswith(prefixes)]
                batches[subscribed] = (b"".join(map(make_frame, matching)), matching)
            frames, matching = batches[subscribed]
            if not matching or peer.unsent_bytes + len(frames) > _MAX_PENDING_BYTES:
                continue
            if peer.session.channel is None:
                self._server.send_raw(peer, frames)
            else:
                self._server.send_messages(peer, matching)
