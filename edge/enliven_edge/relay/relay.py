"""Forwards the streams of one edge to many viewers, answers their questions, and refuses their orders.

It uses the edge's own servers, not the proxy of libzmq (``zmq.proxy``), for four reasons. libzmq aborts its
process in some floods (see :mod:`enliven.wire.zmtp`), and the viewers of a relay are more often untrusted. A
proxy has no state, so a late viewer would wait for the next change of each topic. A proxy with keys needs
another thread that admits viewers. And this loop sends all messages of one frame to a viewer in one system
call, so it is as fast for hundreds of viewers (docs/many-edges.md).
"""

from __future__ import annotations

import logging
import time

import msgspec

from enliven.errors import InputError
from enliven.logs import escape_records
from enliven.peers.clock_probe import ClockProbe
from enliven.supervision.closeable import Closeable
from enliven.wire import (
    REQUEST,
    Answer,
    Ask,
    Endpoint,
    FinishPairing,
    GetState,
    Hello,
    Order,
    Ping,
    Pong,
    Refused,
    ShowCode,
    StartPairing,
    StatusMessage,
    pack_stream,
)
from enliven_edge.network.access import Access, peer_role
from enliven_edge.network.connection import Connection
from enliven_edge.network.control_socket import ControlSocket
from enliven_edge.network.permissions import refusal_reason
from enliven_edge.network.server import ZmtpServer
from enliven_edge.network.subscribers import Subscribers
from enliven_edge.network.tcp_listener import check_open
from enliven_edge.relay.upstream import Upstream
from enliven_edge.settings import WireSettings

log = logging.getLogger(__name__)

RELAY_PORT = 5600
"""Default TCP port of a relay's streams, ten above the edge's. The requests have the next port."""
_POLL_INTERVAL_MS = 5
"""Maximum wait for messages of the edge, in milliseconds. A viewer's request waits at most this long."""
_BUDGET_S = 0.02
"""Seconds per poll for reading and answering requests. A relay has no frame loop that requests could
delay."""
_MIN_HEARTBEAT_INTERVAL_S = 0.05
"""Minimum seconds between heartbeats that new viewers may trigger."""
MAX_RELAYED_VIEWERS = 1000
"""Default maximum number of connections of each port. A viewer uses one connection of each port."""


class Relay(Closeable):
    """The streams of one edge, on ports of this machine. Used from one thread.

    Args:
        edge: address of the edge, which need not be running yet. It may be another relay.
        wire: name, host and ports of the relay, as for an edge.
        access: the keys and the paired viewers of the relay; None without keys.
        viewers: maximum number of connections of each port.

    Attributes:
        endpoint: the address for viewers, with the actual ports.

    Raises:
        InputError: if a key file is damaged, the address is this relay's own, or other machines reach it
            without keys, unless ``insecure`` is set.
        ResourceError: for a port in use.
    """

    def __init__(
        self,
        edge: Endpoint,
        wire: WireSettings,
        access: Access | None = None,
        viewers: int = MAX_RELAYED_VIEWERS,
    ) -> None:
        escape_records()
        check_open(wire.host, wire.insecure or access is not None)
        if wire.port and edge == Endpoint(edge.host, wire.port, wire.control_port) and edge.host == wire.host:
            raise InputError(
                "a relay cannot relay itself", where=str(edge), remedy="Choose another port with --port."
            )
        curve = None if access is None else access.curve
        self._access = access
        self._streams = Subscribers(wire.host, wire.port, "--port", curve, viewers)
        try:
            self._server = ZmtpServer(
                *(wire.host, wire.control_port, "--control-port", "ROUTER", REQUEST.max_bytes + 64),
                max_connections=viewers,
                curve=curve,
            )
        except BaseException:
            self._streams.close()
            raise
        shown_host = (
            "127.0.0.1" if wire.host in ("0.0.0.0", "*", "") else "::1" if wire.host == "::" else wire.host
        )
        self.endpoint = Endpoint(shown_host, self._streams.port, self._server.port)
        self._control = ControlSocket(self._server, self._answer, self._refusal_reason, wire.rate, _BUDGET_S)
        self._last_heartbeat_at = 0.0
        try:
            self._upstream = Upstream(edge, wire.name)
        except BaseException:
            self._streams.close()
            self._server.close()
            raise
        self._probe = ClockProbe(edge, wire.name)

    @property
    def viewers(self) -> int:
        """Returns the number of viewers that received the streams within the last seconds."""
        return self._control.viewers

    @property
    def status(self) -> StatusMessage | None:
        """Returns the edge's last heartbeat, or None before the first one."""
        return self._upstream.state.status

    def poll(self, wait_ms: int = _POLL_INTERVAL_MS) -> None:
        """Waits briefly for messages of the edge, forwards them, and answers viewers."""
        self._upstream.wait_for_message(wait_ms)
        old_missing = self._upstream.state.missing
        messages = [self._with_own_pairing(data) for data in self._upstream.poll()]
        if messages:
            self._streams.send_all(messages)
        if old_missing and not self._upstream.state.missing:
            self._send_heartbeat()  # Viewers request the list of characters again, which is complete now.
        self._streams.poll()
        for command in self._control.poll():
            command.reply(Refused(self._refusal_text))
        if self._access is not None:
            self._access.enforce_pairing((self._server, self._streams.server))

    def close(self) -> None:
        """Releases the ports, and ends the connection to the edge."""
        self._probe.close()
        self._upstream.close()
        self._server.drain(1.0)
        self._streams.drain(1.0)
        self._server.close()
        self._streams.close()

    @property
    def _refusal_text(self) -> str:
        """Returns the reason for refusing an order."""
        status = self.status
        name = "an edge" if status is None else f"the edge {status.edge!r}"
        return (
            f"this is a relay of {name}, and its viewers can only watch. "
            f"Connect to the edge itself to control characters: {self._upstream.endpoint}"
        )[:400]

    def _refusal_reason(self, kind: type[Ask], peer: Connection) -> str:
        """Returns why a viewer may not send a request, or an empty string if it may."""
        role = peer_role(self._access, peer, "watch")
        if role is not None and issubclass(kind, Order):
            return self._refusal_text
        return refusal_reason(kind, role, peer.address)

    def _answer(self, request: Ask, peer: Connection) -> Answer | bytes:
        """Returns the answer to a question."""
        match request:
            case Hello():
                self._send_first_heartbeat(request.listening)
                waiting = Refused(f"this relay waits for the edge at {self._upstream.endpoint}")
                return self._upstream.state.welcome("watch") or waiting
            case GetState():
                refusal = Refused(f"unknown character {request.character!r}")
                return self._upstream.state.packed.get(request.character, refusal)
            case Ping():
                self._send_first_heartbeat(request.listening)
                # Viewers synchronise with the clock of the edge, which stamped the poses.
                offset = self._probe.wall_offset_ns() if self._probe.is_known else 0
                arrived_ns = peer.arrived_ns + offset if peer.arrived_ns else 0
                return Pong(request.sent_ns, time.time_ns() + offset, arrived_ns)
            case StartPairing() | FinishPairing() | ShowCode() if self._access is not None:
                return self._access.answer(request, peer)
            case StartPairing() | FinishPairing() | ShowCode():
                return Refused("this relay uses no keys, so viewers need no pairing")
            case _:
                return Refused(self._refusal_text)

    def _send_first_heartbeat(self, is_listening: bool) -> None:
        """Sends the last heartbeat to a viewer that the streams have not reached yet, with a rate limit."""
        waited_s = time.monotonic() - self._last_heartbeat_at
        if not is_listening and self._upstream.is_heard and waited_s >= _MIN_HEARTBEAT_INTERVAL_S:
            self._send_heartbeat()

    def _send_heartbeat(self) -> None:
        """Sends the edge's last heartbeat again."""
        self._last_heartbeat_at = time.monotonic()
        self._streams.poll()
        if self.status is not None:
            self._streams.send(self._with_own_pairing(pack_stream(self.status)))

    def _with_own_pairing(self, data: bytes) -> bytes:
        """Returns the data of a message to forward.

        In a heartbeat, it sets the remaining time for pairing with this relay.
        """
        status = self.status
        if status is None or not data.startswith(b"status\0"):
            return data
        pairing_s = 0 if self._access is None else self._access.desk.seconds_left
        if status.pairing_s == pairing_s:
            return data
        return pack_stream(msgspec.structs.replace(status, pairing_s=pairing_s))


def relay_settings(name: str, host: str, port: int, control_port: int | None, insecure: bool) -> WireSettings:
    """Returns the settings of a relay. A pairing with it grants only the role *watch*."""
    return WireSettings(
        name=name,
        host=host,
        port=port,
        control_port=(port + 1 if port else 0) if control_port is None else control_port,
        insecure=insecure,
        pairing_role="watch",
    )
