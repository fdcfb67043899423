"""The relay's connection to its edge. It connects as a viewer, and also requests all characters."""

from __future__ import annotations

import logging
import math
import time
from dataclasses import dataclass
from typing import Any

import zmq

from enliven.errors import EnlivenError
from enliven.keys.client import ClientKeys, HandshakeMonitor, handshake_advice
from enliven.wire import (
    MAX_STREAM_BYTES,
    MAX_UNREAD_REPLIES,
    MAX_UNREAD_STREAMS,
    REPLY,
    STATUS,
    Answer,
    Ask,
    CharacterMessage,
    Endpoint,
    GetState,
    Hello,
    MalformedMessageError,
    OtherVersionError,
    Ping,
    RejectCounter,
    Request,
    StatusMessage,
    Welcome,
    make_socket,
    pack_control,
    unpack_control,
    unpack_stream,
)
from enliven_edge.relay.relayed_state import RelayedState

log = logging.getLogger(__name__)

_REQUEST_INTERVAL_S = 1.0
"""Seconds between two identical requests."""
_CHARACTER_TIMEOUT_S = 10.0
"""Seconds to wait for a requested character, which may transfer megabytes over a slow network."""
_MAX_PENDING = 4
"""Maximum number of characters that are requested at the same time."""
_SILENCE_TIMEOUT_S = 2.0
"""Seconds without a heartbeat after which the edge counts as silent: four heartbeats."""
_REOPEN_INTERVAL_S = 2.0
"""Seconds after a failed handshake until the connection is opened again. By then the user may have paired."""
_MAX_MESSAGES_PER_POLL = 256
"""Maximum number of messages that one poll reads. The limit keeps the relay responsive in a flood."""


@dataclass
class _Pending:
    body: Ask
    deadline: float


class Upstream:
    """The SUB and DEALER sockets to an edge, which need not be running yet.

    Args:
        endpoint: address of the edge.
        name: name of this relay in the edge's log.

    Attributes:
        state: the state for this relay's viewers.

    Raises:
        InputError: if a key file is damaged, or others may read it.
    """

    def __init__(self, endpoint: Endpoint, name: str) -> None:
        self.endpoint, self.state = endpoint, RelayedState()
        self._name = name[:64]
        self._context: zmq.Context[Any] = zmq.Context.instance()
        self._rejects = RejectCounter(f"edge at {endpoint}")
        self._pending: dict[int, _Pending] = {}
        self._number = 0
        self._asked_at: dict[str, float] = {}
        self._heard_at = self._hello_at = self._ping_at = -math.inf
        self._problem, self._reopen_at = "", math.inf
        self._open(endpoint.find_keys())

    @property
    def is_heard(self) -> bool:
        """Returns True if heartbeats of the edge arrive."""
        return time.monotonic() - self._heard_at < _SILENCE_TIMEOUT_S

    def wait_for_message(self, milliseconds: int) -> None:
        """Waits until the edge has sent a message, or until the time is over."""
        self._poller.poll(milliseconds)

    def poll(self) -> list[bytes]:
        """Returns the messages of the edge to forward to viewers, and requests missing data."""
        self._watch_handshake()
        self._read_replies()
        messages = []
        for _ in range(_MAX_MESSAGES_PER_POLL):
            try:
                data = b"".join(self._stream.recv_multipart(zmq.DONTWAIT))
            except zmq.Again:
                break
            if self._receive(data):
                messages.append(data)
        self._request_missing_state()
        return messages

    def close(self) -> None:
        """Closes the sockets."""
        self._watch.close()
        self._stream.close(linger=0)
        self._requests.close(linger=0)

    def _open(self, keys: ClientKeys | None) -> None:
        self._stream = make_socket(self._context, zmq.SUB, MAX_STREAM_BYTES, MAX_UNREAD_STREAMS, keys)
        self._watch = HandshakeMonitor(self._stream, keys is not None)
        self._stream.setsockopt(zmq.SUBSCRIBE, b"")
        self._stream.connect(self.endpoint.stream_address)
        max_bytes = REPLY.max_bytes + 64
        self._requests = make_socket(self._context, zmq.DEALER, max_bytes, MAX_UNREAD_REPLIES, keys)
        self._requests.setsockopt(zmq.IMMEDIATE, 1)
        self._requests.connect(self.endpoint.control_address)
        self._poller = zmq.Poller()
        for socket in (self._stream, self._requests):
            self._poller.register(socket, zmq.POLLIN)

    def _watch_handshake(self) -> None:
        """Logs keys that do not match, and connects again later.

        libzmq does not retry after such a failure.
        """
        self._watch.poll()
        now = time.monotonic()
        if self._watch.problem and self._reopen_at == math.inf:
            self._reopen_at = now + _REOPEN_INTERVAL_S
            advice = handshake_advice(self._watch.problem, self.endpoint.host)
            self._report(f"the edge at {self.endpoint} {advice}")
        elif now >= self._reopen_at:
            self._reopen_at = math.inf
            try:
                keys = self.endpoint.find_keys()
            except EnlivenError as error:
                self._reopen_at = now + _REOPEN_INTERVAL_S
                self._report(str(error))
                return
            self.close()
            self._pending.clear()
            self._open(keys)

    def _report(self, problem: str) -> None:
        """Logs each problem once."""
        if problem != self._problem:
            self._problem = problem
            log.warning("%s", problem)

    def _receive(self, data: bytes) -> bool:
        """Processes one stream message. Returns False if it must not be forwarded to viewers."""
        try:
            topic, message = unpack_stream(data)
        except MalformedMessageError as error:
            if isinstance(error, OtherVersionError):
                self._report(
                    f"the edge at {self.endpoint}: {error}; install the same release of enliven on both "
                    "computers"
                )
            self._rejects.add(error)
            return False
        if topic is STATUS:
            self._store_status(message)
        else:
            self.state.store_latched(topic, message, data)
        return True

    def _store_status(self, status: StatusMessage) -> None:
        if not self.is_heard:
            log.info("connected to %s at %s", status.edge, self.endpoint)
        self._heard_at, self._problem = time.monotonic(), ""
        if self.state.status is not None and self.state.status.instance != status.instance:
            log.info("%s has restarted", status.edge)
            self.state.restart()
            self._asked_at.clear()
            self._hello_at = -math.inf
        self.state.status = status

    def _request_missing_state(self) -> None:
        """Requests the state if it has changed, and characters that are missing."""
        now = time.monotonic()
        for number in [n for n, pending in self._pending.items() if pending.deadline < now]:
            del self._pending[number]
        waiting_kinds = {type(pending.body) for pending in self._pending.values()}
        if (
            not self.state.is_listed
            and now - self._hello_at >= _REQUEST_INTERVAL_S
            and Hello not in waiting_kinds
        ):
            self._hello_at = now
            self._send(Hello(self._name, self.is_heard), _REQUEST_INTERVAL_S)
        if now - self._ping_at >= _REQUEST_INTERVAL_S:
            self._ping_at = now
            self._send(Ping(self._name, time.time_ns(), self.is_heard), _REQUEST_INTERVAL_S)
        for character in self.state.missing:
            pending = [p.body.character for p in self._pending.values() if isinstance(p.body, GetState)]
            is_due = now - self._asked_at.get(character, -math.inf) >= _REQUEST_INTERVAL_S
            if character not in pending and len(pending) < _MAX_PENDING and is_due:
                self._asked_at[character] = now
                self._send(GetState(character), _CHARACTER_TIMEOUT_S)

    def _send(self, body: Ask, seconds: float) -> None:
        self._number += 1
        try:
            self._requests.send(pack_control(Request(self._number, body)), zmq.DONTWAIT)
        except zmq.ZMQError:
            return
        self._pending[self._number] = _Pending(body, time.monotonic() + seconds)

    def _read_replies(self) -> None:
        for _ in range(_MAX_MESSAGES_PER_POLL):
            try:
                data = b"".join(self._requests.recv_multipart(zmq.DONTWAIT))
            except zmq.Again:
                return
            try:
                reply = unpack_control(data, REPLY)
                if self._pending.pop(reply.id, None) is not None:
                    self._handle_answer(reply.body)
            except MalformedMessageError as error:
                self._rejects.add(error)

    def _handle_answer(self, answer: Answer) -> None:
        match answer:
            case Welcome():
                self._store_status(answer.status)
                self.state.list_characters(answer)
            case CharacterMessage() if (
                not self.state.add_character(answer) and answer.id in self.state.wanted
            ):
                self._report(
                    f"the character {answer.id!r} is not relayed, because the relay has no memory left for it"
                )
