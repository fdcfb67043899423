"""The edge's control socket: requests in, checked; replies out; never a wait for anybody."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import zmq

from enliven.wire.envelope import Malformed, OtherVersion, Rejects, pack_control, unpack_control
from enliven.wire.messages import Answer, Ask, Done, Hello, Order, Ping, Refused, Reply, Request
from enliven.wire.topics import REQUEST

_MOST_PER_POLL = 256
_GONE_AFTER = 5.0
"""Seconds without a word after which a viewer is not counted any more."""


@dataclass
class Command:
    """Something that a viewer asks for and only the stage can do; answer it once.

    Attributes:
        request: an order such as :class:`~enliven.wire.messages.Possess`.
        viewer: the name of the viewer that asks.
    """

    request: Order
    viewer: str
    _reply: Callable[[Answer], None] = field(repr=False)

    def reply_done(self, note: str = "") -> None:
        """It was carried out."""
        self._reply(Done(note[:400]))

    def reply_refused(self, reason: str) -> None:
        """It was not, and why; the viewer shows the sentence."""
        self._reply(Refused(reason[:400]))


@dataclass
class _Viewer:
    name: str
    listening: bool
    heard: float


class Control:
    """Wraps a bound ROUTER socket.

    Args:
        answer: what to reply to everything but commands.
    """

    def __init__(self, socket: zmq.Socket[bytes], answer: Callable[[Ask], Answer]) -> None:
        self._socket, self._answer = socket, answer
        self._viewers: dict[bytes, _Viewer] = {}
        self.rejects = Rejects("edge, requests")

    @property
    def viewers(self) -> int:
        """Viewers that the streams reach, and that were heard of in the last seconds."""
        now = time.monotonic()
        self._viewers = {k: v for k, v in self._viewers.items() if now - v.heard < _GONE_AFTER}
        return sum(v.listening for v in self._viewers.values())

    def poll(self) -> list[Command]:
        """Answers what has come; returns the commands among it. A flood is left for the next call."""
        commands = []
        for _ in range(_MOST_PER_POLL):
            try:
                sender, *parts = self._socket.recv_multipart(zmq.DONTWAIT)
            except zmq.Again:
                break
            command = self._take(sender, parts)
            if command is not None:
                commands.append(command)
        return commands

    def _take(self, sender: bytes, parts: list[bytes]) -> Command | None:
        """One message of a viewer."""
        try:
            if len(parts) != 1:
                raise Malformed("request", f"{len(parts)} parts instead of one")
            request: Request = unpack_control(parts[0], REQUEST)
        except Malformed as error:
            self.rejects.add(error)
            if isinstance(error, OtherVersion):
                self._send(sender, Reply(0, Refused(str(error))))
            return None
        body = request.body
        if isinstance(body, Hello | Ping):
            self._viewers[sender] = _Viewer(body.viewer, body.listening, time.monotonic())
        if not isinstance(body, Order):
            self._send(sender, Reply(request.id, self._answer(body)))
            return None
        known = self._viewers.get(sender)
        return Command(
            body, known.name if known else "a viewer", lambda a: self._send(sender, Reply(request.id, a))
        )

    def _send(self, viewer: bytes, reply: Reply) -> None:
        """To a viewer that may be gone, or not read: then it is dropped, and the viewer asks again."""
        with contextlib.suppress(zmq.ZMQError):
            self._socket.send_multipart([viewer, pack_control(reply)], zmq.DONTWAIT)
