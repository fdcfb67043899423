"""The edge's control port: checks requests and sends replies without blocking."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field

from enliven.wire import (
    REQUEST,
    Answer,
    Ask,
    Hello,
    MalformedMessageError,
    Order,
    OtherVersionError,
    Ping,
    Refused,
    RejectCounter,
    Request,
    pack_payload,
    reply_prefix,
    unpack_control,
)
from enliven_edge.network.connection import Connection
from enliven_edge.network.server import ZmtpServer

log = logging.getLogger(__name__)

_VIEWER_TIMEOUT_S = 5.0
"""Seconds without a message after which a viewer is no longer counted."""


@dataclass
class Command:
    """A request that only the stage can carry out. It must be answered exactly once.

    Attributes:
        request: an order such as :class:`~enliven.wire.requests.Possess`.
        viewer: the name of the viewer that sent it.
        peer: the viewer's connection.
        subject: a newer command of the same viewer with an equal subject replaces this one. If None, it is
            never replaced.
    """

    request: Order
    viewer: str
    peer: Connection = field(repr=False)
    _reply: Callable[[Answer], None] = field(repr=False)
    subject: Hashable = None

    def reply(self, answer: Answer) -> None:
        """Sends the result to the viewer."""
        self._reply(answer)


@dataclass
class _Viewer:
    """The state of a connection. It is dropped together with the connection.

    Attributes:
        tokens: number of requests that it may still send now (token bucket).
        refilled_at: monotonic time in seconds when ``tokens`` was last refilled.
    """

    tokens: float
    refilled_at: float
    name: str = "a viewer"
    listening: bool = False
    last_message_at: float = -_VIEWER_TIMEOUT_S


class ControlSocket:
    """Answers the requests that arrive at a server.

    Args:
        answer: returns the reply to a peer's request that is not a command: a message, or a packed one.
        refusal: returns why a peer may not send a kind of request, or an empty string if it may.
        rate: rate limit: maximum answered requests per second of one viewer, and maximum size of a burst.
            Further requests are refused.
        budget: seconds per poll for reading and answering. Further requests stay in the senders' buffers.
    """

    def __init__(
        self,
        server: ZmtpServer,
        answer: Callable[[Ask, Connection], Answer | bytes],
        refusal: Callable[[type[Ask], Connection], str],
        rate: float,
        budget: float,
    ) -> None:
        self._server, self._answer, self._refusal = server, answer, refusal
        self._rate, self._budget = rate, budget
        self.rejects = RejectCounter("edge, requests")
        self.refused = 0

    @property
    def viewers(self) -> int:
        """Returns the number of viewers that receive the streams and have sent a message recently."""
        min_seen_s = time.monotonic() - _VIEWER_TIMEOUT_S
        states = (c.state for c in self._server.connections if c.state is not None)
        return sum(viewer.listening and viewer.last_message_at > min_seen_s for viewer in states)

    def poll(self) -> list[Command]:
        """Answers requests as far as time allows. Returns the commands for the stage among them."""
        deadline = time.monotonic() + self._budget
        commands = (self._handle_message(peer, parts) for peer, parts in self._server.messages(deadline))
        return [command for command in commands if command is not None]

    def _handle_message(self, peer: Connection, parts: list[bytes]) -> Command | None:
        now = time.monotonic()
        if peer.state is None:
            peer.state = _Viewer(self._rate, now)
        viewer: _Viewer = peer.state
        try:
            if len(parts) != 1:
                raise MalformedMessageError("request", f"{len(parts)} parts instead of 1")
            request: Request[Ask] = unpack_control(parts[0], REQUEST)
        except MalformedMessageError as error:
            self.rejects.add(error)
            if isinstance(error, OtherVersionError):
                peer.introduced = True
                self._send(peer, 0, Refused(str(error)))
            return None
        peer.introduced, peer.last_message_at = True, now
        if not self._may_send(viewer, now):
            self._refuse(peer, request.id)
            return None
        body = request.body
        reason = self._refusal(type(body), peer)
        if reason:
            self._send(peer, request.id, Refused(reason))
            return None
        if isinstance(body, Hello | Ping) and not (isinstance(body, Ping) and body.probe):
            viewer.name, viewer.listening, viewer.last_message_at = body.viewer, body.listening, now
        if not isinstance(body, Order):
            self._send(peer, request.id, self._answer(body, peer))
            return None
        peer.pending += 1
        return Command(body, viewer.name, peer, lambda answer: self._reply(peer, request.id, answer))

    def _may_send(self, viewer: _Viewer, now: float) -> bool:
        """Returns True if a viewer may send one more request now."""
        viewer.tokens = min(viewer.tokens + (now - viewer.refilled_at) * self._rate, self._rate)
        viewer.refilled_at = now
        if viewer.tokens < 1:
            return False
        viewer.tokens -= 1
        return True

    def _refuse(self, peer: Connection, number: int) -> None:
        """Refuses a viewer that exceeds the rate limit. Every refusal is sent to the viewer, but only the
        first is logged.
        """
        self.refused += 1
        if self.refused == 1:
            log.warning(
                "the viewer %r at %s sends more than %g requests a second. Requests above this rate are "
                "refused, which is logged only once.",
                peer.state.name,
                peer.address,
                self._rate,
            )
        self._send(
            peer,
            number,
            Refused(f"this viewer sends more than {self._rate:g} requests a second. Send fewer requests."),
        )

    def _reply(self, peer: Connection, number: int, answer: Answer) -> None:
        peer.pending -= 1
        self._send(peer, number, answer)

    def _send(self, peer: Connection, number: int, answer: Answer | bytes) -> None:
        """Sends an answer to a viewer. Sends nothing to a closed connection."""
        payload = answer if isinstance(answer, bytes) else pack_payload(answer)
        self._server.send(peer, reply_prefix(number), payload)
