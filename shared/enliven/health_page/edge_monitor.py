"""Receives the heartbeats of several edges and measures the age of their frames. It connects as a viewer with
the role "watch"."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import zmq

from enliven.errors import EnlivenError, InputError
from enliven.health_page.snapshot import MonitoredEdge
from enliven.keys.client import ClientKeys, HandshakeMonitor, handshake_advice
from enliven.kiosk.profile import KioskEdge
from enliven.logs import escape_text
from enliven.wire import (
    BODIES,
    POSE_PORT,
    STATUS,
    Endpoint,
    MalformedMessageError,
    OtherVersionError,
    StatusMessage,
    make_socket,
    parse_endpoint,
    unpack_stream,
)

_MAX_MESSAGE_BYTES = 64 * 1024
"""Maximum size of a message in bytes. Messages of the subscribed topics have at most a quarter of this
size."""
_MAX_UNREAD = 200
"""Maximum number of unread messages of one edge. An edge sends this number in several seconds."""
_MAX_READS_PER_POLL = 64
"""Maximum number of messages of one edge that are read at once, so that a flood from one edge does not delay
the others."""
_KEY_CHECK_INTERVAL_S = 10.0
"""Time without heartbeats, in seconds, after which the keys are read again, because a pairing may have
changed them."""
_POLL_SLICE_MS = 100
"""Interval in milliseconds at which the connections are checked while waiting for messages."""
_STATUS_PREFIX = STATUS.name.encode() + b"\0"
"""First bytes of a heartbeat."""
_FRAME_PREFIX = BODIES.name.encode() + b"\0"
"""First bytes of a message with the bodies of a frame. An edge sends one per frame, even if there are no
people."""


def edge_endpoint(edge: KioskEdge) -> Endpoint:
    """Returns the address of an edge in a profile. A port in the address takes precedence over ``port``.

    Raises:
        InputError: if the address is invalid.
    """
    endpoint = parse_endpoint(edge.address or "127.0.0.1")
    if endpoint.pose_port != POSE_PORT:
        return endpoint
    return Endpoint(endpoint.host, edge.port, edge.port + 1)


@dataclass
class _EdgeConnection:
    """The connection to one edge.

    Attributes:
        name: name of the edge in the profile.
        endpoint: its address.
        since_s: start of the first attempt, in seconds of the monotonic clock.
        socket: the SUB socket, or None if the keys cannot be read.
        watch: monitors the handshakes of the socket.
        keys: the keys of the socket.
        checked_s: time of the last check of the keys, in seconds of the monotonic clock.
        status: the newest heartbeat.
        status_s: time at which the newest heartbeat arrived.
        first_s: time at which the first heartbeat arrived.
        frame_s: time at which the newest frame's result arrived.
        fault: the reason why heartbeats cannot be read, and the remedy.
    """

    name: str
    endpoint: Endpoint
    since_s: float
    socket: zmq.Socket[bytes] | None = None
    watch: HandshakeMonitor | None = None
    keys: ClientKeys | None = None
    checked_s: float = 0.0
    status: StatusMessage | None = None
    status_s: float | None = None
    first_s: float | None = None
    frame_s: float | None = None
    fault: tuple[str, str] = field(default=("", ""))


class EdgeMonitor:
    """The connections to all edges of a profile, with their newest heartbeats.

    Only one thread at a time may use it. Connections stay open, and libzmq reconnects if they break.

    Args:
        edges: the edges by name.

    Raises:
        InputError: if an address is invalid.
    """

    def __init__(self, edges: Mapping[str, KioskEdge]) -> None:
        self._context: zmq.Context[Any] = zmq.Context.instance()
        time_now = time.monotonic()
        self._links = [_EdgeConnection(name, edge_endpoint(edge), time_now) for name, edge in edges.items()]
        self._poller = zmq.Poller()
        for link in self._links:
            self._open_connection(link)

    @property
    def endpoints(self) -> dict[str, Endpoint]:
        """The addresses of the edges by name."""
        return {link.name: link.endpoint for link in self._links}

    def poll(self, seconds: float) -> int:
        """Receives messages for ``seconds``. Returns the number of heartbeats."""
        heartbeats, end = 0, time.monotonic() + seconds
        while True:
            remaining_ms = 1000.0 * (end - time.monotonic())
            ready = dict(self._poller.poll(max(0, min(round(remaining_ms), _POLL_SLICE_MS))))
            for link in self._links:
                if link.socket is not None and link.socket in ready:
                    heartbeats += self._read_messages(link)
            self._check_links()
            if remaining_ms <= 0.0:
                return heartbeats

    def states(self) -> tuple[MonitoredEdge, ...]:
        """Returns the state of each edge, in the order of the profile."""
        time_now = time.monotonic()
        return tuple(
            MonitoredEdge(
                name=link.name,
                address=str(link.endpoint),
                status=link.status,
                heartbeat_age_s=None if link.status_s is None else time_now - link.status_s,
                frame_age_s=None if link.frame_s is None else time_now - link.frame_s,
                waiting_s=time_now - (link.since_s if link.status_s is None else link.status_s),
                heard_s=0.0 if link.first_s is None else time_now - link.first_s,
                fault=link.fault[0],
                remedy=link.fault[1],
            )
            for link in self._links
        )

    def close(self) -> None:
        """Closes all connections."""
        for link in self._links:
            self._close_connection(link)

    def _read_messages(self, link: _EdgeConnection) -> int:
        """Reads the messages of an edge that have arrived. Returns the number of heartbeats."""
        heartbeats = 0
        for _ in range(_MAX_READS_PER_POLL):
            try:
                data = b"".join(link.socket.recv_multipart(zmq.DONTWAIT)) if link.socket else b""
            except zmq.ZMQError:
                break
            heartbeats += self._store_message(link, data)
        return heartbeats

    def _store_message(self, link: _EdgeConnection, data: bytes) -> bool:
        """Stores one message. Returns True if it was a valid heartbeat."""
        if data.startswith(_FRAME_PREFIX):
            link.frame_s = time.monotonic()
            return False
        if not data.startswith(_STATUS_PREFIX):
            return False
        try:
            _, message = unpack_stream(data)
        except OtherVersionError as error:
            link.fault = (
                escape_text(str(error.why)),
                "Install the same version of enliven on both machines.",
            )
            return False
        except MalformedMessageError as error:
            link.fault = (
                f"the heartbeat of the edge is damaged ({escape_text(error.why)[:200]})",
                "Check that the program at this address is an edge of enliven.",
            )
            return False
        link.status, link.status_s, link.fault = message, time.monotonic(), ("", "")
        link.first_s = link.first_s or link.status_s
        return True

    def _check_links(self) -> None:
        """Reads the results of handshakes, and reads the keys of silent edges again."""
        time_now = time.monotonic()
        for link in self._links:
            if link.watch is not None:
                link.watch.poll()
                if link.watch.problem:
                    problem, _, remedy = handshake_advice(link.watch.problem, link.endpoint.host).partition(
                        ". "
                    )
                    link.fault = (f"the edge {problem}", f"{remedy}.")
            heard_s = link.since_s if link.status_s is None else link.status_s
            if time_now - max(heard_s, link.checked_s) > _KEY_CHECK_INTERVAL_S:
                self._renew_keys(link)

    def _renew_keys(self, link: _EdgeConnection) -> None:
        """Reconnects to a silent edge if its keys have changed."""
        link.checked_s = time.monotonic()
        try:
            has_changed = link.socket is None or link.endpoint.find_keys() != link.keys
        except InputError:
            has_changed = True
        if has_changed:
            self._close_connection(link)
            self._open_connection(link)

    def _open_connection(self, link: _EdgeConnection) -> None:
        """Connects to an edge. If its keys cannot be read, stores the reason instead."""
        link.checked_s = time.monotonic()
        try:
            link.keys = link.endpoint.find_keys()
        except EnlivenError as error:
            link.fault = (f"{error.where}: {error.what}" if error.where else error.what, error.remedy)
            return
        link.fault = ("", "")
        socket = make_socket(self._context, zmq.SUB, _MAX_MESSAGE_BYTES, _MAX_UNREAD, link.keys)
        link.socket, link.watch = socket, HandshakeMonitor(socket, link.keys is not None)
        for prefix in (_STATUS_PREFIX, _FRAME_PREFIX):
            socket.setsockopt(zmq.SUBSCRIBE, prefix)
        socket.connect(link.endpoint.stream_address)
        self._poller.register(socket, zmq.POLLIN)

    def _close_connection(self, link: _EdgeConnection) -> None:
        """Closes the connection to an edge."""
        if link.socket is not None and link.watch is not None:
            self._poller.unregister(link.socket)
            link.watch.close()
            link.socket.close(linger=0)
        link.socket = link.watch = None
