"""The edge's side of the wire: sends poses, bodies, cues and heartbeats, and receives requests."""

from __future__ import annotations

import contextlib
import logging
import math
import secrets
import time
from typing import Any

import msgspec

from enliven.document import Character, Pose
from enliven.logs import escape_records
from enliven.supervision.closeable import Closeable
from enliven.wire import (
    BY_TYPE,
    CONTROL_PORT,
    MAX_CHARACTERS,
    MAX_LATCHED_MESSAGES,
    MAX_REVISION,
    POSE_PORT,
    REQUEST,
    STATUS,
    STREAMS,
    Answer,
    Ask,
    Endpoint,
    FinishPairing,
    GetState,
    Hello,
    MalformedMessageError,
    Ping,
    Pong,
    PoseCodec,
    PoseMessage,
    Refused,
    RejectCounter,
    Revision,
    ShowCode,
    StartPairing,
    StatusMessage,
    Welcome,
    character_to_message,
    pack_checked,
    pack_payload,
)
from enliven_edge.network.access import Access, peer_role
from enliven_edge.network.connection import Connection
from enliven_edge.network.control_socket import Command, ControlSocket
from enliven_edge.network.name_lock import NameLock
from enliven_edge.network.permissions import refusal_reason
from enliven_edge.network.server import ZmtpServer
from enliven_edge.network.subscribers import Subscribers
from enliven_edge.network.tcp_listener import check_open

log = logging.getLogger(__name__)

_MIN_HEARTBEAT_INTERVAL_S = 0.05
"""Minimum seconds between heartbeats that viewers may trigger."""


class Publisher(Closeable):
    """One port for streams and one for requests. Used from one thread, without blocking.

    Viewers connect with libzmq's SUB and DEALER sockets. A slow or dead viewer loses messages, but other
    viewers do not. A viewer that joins late gets the state, the characters, and each character's newest pose
    and cues. Call :meth:`poll` at least a few times per second: it answers viewers and sends the heartbeat.
    Use it as a context manager, or :meth:`close` it.

    Args:
        name: name of the edge, unique on a machine.
        host: the address to listen on, "0.0.0.0" for all.
        pose_port: port of the streams. 0 picks a free one.
        control_port: port of the requests. 0 picks a free one.
        access: the keys and the paired viewers. If None, everyone who reaches the ports may do everything.
        open_to_all: True allows an address that other machines reach without keys.
        rate: rate limit: maximum answered requests per second of one viewer.
        budget_ms: milliseconds per poll for reading and answering.

    Attributes:
        name: name of the edge.
        instance: random number of this start of the edge.
        endpoint: the address for viewers, with the actual ports.
        clamped: total number of transforms that were not finite or too large, and were clamped.

    Raises:
        ResourceError: for a port in use, an address that does not belong to this machine, or a name in use.
        InputError: for an address that other machines reach without keys, unless ``open_to_all`` is set.
    """

    def __init__(
        self,
        *,
        name: str = "edge",
        host: str = "127.0.0.1",
        pose_port: int = POSE_PORT,
        control_port: int = CONTROL_PORT,
        access: Access | None = None,
        open_to_all: bool = False,
        rate: float = 100.0,
        budget_ms: float = 1.0,
    ) -> None:
        escape_records()
        check_open(host, open_to_all or access is not None)
        self.name, self.instance = name[:64] or "edge", secrets.randbits(32)
        self.clamped = 0
        self._access = access
        curve = None if access is None else access.curve
        self._lock = NameLock(self.name)
        with contextlib.ExitStack() as stack:
            stack.callback(self._lock.close)
            self._streams = Subscribers(host, pose_port, "--port", curve)
            stack.callback(self._streams.close)
            max_bytes = REQUEST.max_bytes + 64
            self._server = ZmtpServer(host, control_port, "--control-port", "ROUTER", max_bytes, curve=curve)
            stack.pop_all()
        shown_host = "127.0.0.1" if host in ("0.0.0.0", "*", "") else "::1" if host == "::" else host
        self.endpoint = Endpoint(shown_host, self._streams.port, self._server.port)
        self._control = ControlSocket(
            self._server, self._answer, self._refusal_reason, rate, budget_ms * 1e-3
        )
        self._characters: dict[str, tuple[int, PoseCodec]] = {}
        self._last_removed_revision = 0
        self._packed: dict[str, bytes] = {}
        self._sequences: dict[str, int] = {}
        self._last_sequence = -1
        self._latest: dict[tuple[str, str], bytes] = {}
        self._status = StatusMessage(self.name, self.instance, 0, 0)
        self._last_heartbeat_at = -math.inf
        self._unsent = RejectCounter("edge, sending")

    @property
    def viewers(self) -> int:
        """Returns the number of viewers that received the streams within the last seconds."""
        return self._control.viewers

    @property
    def malformed(self) -> int:
        """Returns the number of requests that could not be read."""
        return self._control.rejects.total

    @property
    def status(self) -> StatusMessage:
        """Returns the content of the next heartbeat."""
        return self._status

    def set_character(self, character: Character, min_revision: int = 1) -> int:
        """Sets a new character, or a new version of the one with its id. Viewers then fetch it.

        Args:
            min_revision: the minimum revision.

        Returns:
            its revision: 1, 2, ... A new character gets a higher revision than all removed characters,
                because it may be one of them that returns.

        Raises:
            InputError: for a character that is too large for the wire. The previous version stays.
        """
        codec = PoseCodec(character)
        # Encode and decode once here, because the first use compiles the codec, which must not happen during
        # a performance.
        codec.decode(codec.encode(character.rest_pose()).data)
        revision = max(self.last_revision(character.id) + 1, min_revision)
        if revision > MAX_REVISION:
            revision = 1  # Restart at 1. Viewers fetch any revision that differs from their own.
        self._packed[character.id] = pack_payload(character_to_message(character, revision))
        self._characters[character.id] = (revision, codec)
        self._notify_state_change()
        return revision

    def remove_character(self, character: str) -> None:
        """Removes a character and all data about it. Viewers then drop it."""
        removed = self._characters.pop(character, None)
        if removed is None:
            return
        self._packed.pop(character, None)
        self._last_removed_revision = max(self._last_removed_revision, removed[0])
        self._last_sequence = max(self._last_sequence, self._sequences.pop(character, -1))
        for name, topic in STREAMS.items():
            if topic.is_per_character:
                self._latest.pop((name, character), None)
        self._notify_state_change()

    def revision(self, character: str) -> int:
        """Returns the revision of a character, or 0 for an unknown id."""
        return self._characters[character][0] if character in self._characters else 0

    def last_revision(self, character: str) -> int:
        """Returns the revision of a character, or the highest revision of removed characters for an unknown
        id.
        """
        return self.revision(character) or self._last_removed_revision

    def publish_pose(self, pose: Pose, captured_ns: int = 0) -> PoseMessage:
        """Quantises, numbers and sends a pose of a character that was set.

        Args:
            captured_ns: wall-clock time (``time.time_ns()``) at which the frame was read.

        Returns:
            the sent message, for a recorder.

        Raises:
            InputError: if the pose has another number of transforms than its character.
            KeyError: for a character that was not set.
        """
        revision, codec = self._characters[pose.character]
        encoded = codec.encode(pose)
        if encoded.clamped and not self.clamped:
            log.warning(
                "%d transforms of %s were not finite or too large; this is logged only once",
                encoded.clamped,
                pose.character,
            )
        self.clamped += encoded.clamped
        sequence = self._sequences.get(pose.character, self._last_sequence) + 1
        self._sequences[pose.character] = sequence
        message = PoseMessage(
            pose.character,
            revision,
            self.instance,
            sequence,
            pose.time_ns,
            captured_ns,
            time.time_ns(),
            encoded.data,
        )
        self.publish(message)
        return message

    def publish(self, message: Any) -> int:
        """Sends a stream message (poses: :meth:`publish_pose`) and returns the bytes that a viewer gets.

        A message that viewers would refuse is counted and not sent, and 0 is returned.
        """
        topic = BY_TYPE[type(message)]
        try:
            data = pack_checked(message)
        except MalformedMessageError as error:
            self._unsent.add(error)
            return 0
        # Do not latch messages about a removed character, because they would stay for ever.
        if topic.latched and not (topic.is_per_character and message.character not in self._characters):
            self._latest[topic.name, topic.key(message)] = data
        self._streams.send(data)
        return len(data)

    def forget(self, topic: str) -> None:
        """Drops the newest messages of a latched topic."""
        self._latest = {key: data for key, data in self._latest.items() if key[0] != topic}

    def set_status(self, **fields: Any) -> None:
        """Changes fields of the heartbeat. A new phase is sent immediately.

        The fields are sensor, phase, note, fps, latency_p50_ms, latency_p99_ms, performers, dropped and
        health."""
        clean_fields = {k: _clean_status_value(v) for k, v in fields.items()}
        old_values, self._status = self._status, msgspec.structs.replace(self._status, **clean_fields)
        if old_values.phase != self._status.phase:
            self.send_heartbeat()

    def poll(self) -> list[Command]:
        """Answers viewers and sends a heartbeat that is due. Returns the commands for the caller."""
        if self._access is not None:
            self._access.enforce_pairing((self._server, self._streams.server))
        if time.monotonic() - self._last_heartbeat_at >= 1 / STATUS.rate_hz:
            self.send_heartbeat()
        self._streams.poll()
        return self._control.poll()

    def send_heartbeat(self) -> None:
        """Sends the heartbeat now."""
        self._last_heartbeat_at = time.monotonic()
        self._streams.poll()
        pairing_s = 0 if self._access is None else self._access.desk.seconds_left
        self._status = msgspec.structs.replace(self._status, published_ns=time.time_ns(), pairing_s=pairing_s)
        self.publish(self._status)

    def close(self, linger: float = 1.0) -> None:
        """Releases the ports and the name. Queued bytes are still sent, for ``linger`` seconds at most."""
        self._server.drain(linger)
        self._streams.drain(linger)
        self._server.close()
        self._streams.close()
        self._lock.close()

    def _notify_state_change(self) -> None:
        """Notifies viewers that the state must be fetched again."""
        self._status = msgspec.structs.replace(self._status, revision=self._status.revision + 1)
        self.send_heartbeat()

    def _send_first_heartbeat(self, listening: bool) -> None:
        """Sends a heartbeat to a viewer that the streams have not reached yet, with a rate limit."""
        if not listening and time.monotonic() - self._last_heartbeat_at >= _MIN_HEARTBEAT_INTERVAL_S:
            self.send_heartbeat()

    def _refusal_reason(self, kind: type[Ask], peer: Connection) -> str:
        """Returns why a peer may not send a request, or an empty string if it may."""
        return refusal_reason(kind, peer_role(self._access, peer, "operate"), peer.address)

    def _answer(self, request: Ask, peer: Connection) -> Answer | bytes:
        """Returns the reply to a request that is not a command."""
        match request:
            case Hello():
                self._send_first_heartbeat(request.listening)
                revisions = [Revision(name, entry[0]) for name, entry in self._characters.items()]
                return Welcome(
                    self._status,
                    revisions[-MAX_CHARACTERS:],
                    list(self._latest.values())[-MAX_LATCHED_MESSAGES:],
                    peer_role(self._access, peer, "operate") or "",
                )
            case GetState():
                refusal = Refused(f"there is no character {request.character!r}")
                return self._packed.get(request.character, refusal)
            case Ping():
                self._send_first_heartbeat(request.listening)
                return Pong(request.sent_ns, time.time_ns(), peer.arrived_ns)
            case StartPairing() | FinishPairing() | ShowCode() if self._access is not None:
                return self._access.answer(request, peer)
            case StartPairing() | FinishPairing() | ShowCode():
                return Refused("this edge uses no keys, so viewers need no pairing")
            case _:
                return Refused("the edge does not support this request")


def _clean_status_value(value: Any) -> Any:
    """Returns the value of a status field in the form that the wire accepts: finite numbers, short
    strings.
    """
    if isinstance(value, float):
        return value if math.isfinite(value) else 0.0
    return value[:200] if isinstance(value, str) else value
