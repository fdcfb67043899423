"""The edge's outlet to the network: poses, bodies, cues and heartbeats out; requests in."""

from __future__ import annotations

import logging
import math
import secrets
import time
from types import TracebackType
from typing import Any

import msgspec
import zmq

from enliven.character import Character, Pose
from enliven.errors import ResourceError
from enliven.wire.convert import character_to_message
from enliven.wire.envelope import pack_stream
from enliven.wire.messages import (
    Answer,
    Ask,
    CharacterMessage,
    GetState,
    Hello,
    Ping,
    Pong,
    PoseMessage,
    Refused,
    Revision,
    StatusMessage,
    Welcome,
)
from enliven.wire.posecode import PoseCodec
from enliven.wire.sockets import CONTROL_PORT, POSE_PORT, Endpoint, make_socket
from enliven.wire.topics import BY_TYPE, REQUEST, STATUS
from enliven_edge.control import Command, Control
from enliven_edge.name_lock import NameLock

log = logging.getLogger(__name__)


class Publisher:
    """PUB for what is published, ROUTER for what is asked; used from one thread, and never waits.

    A viewer that is slow or dead loses messages, nobody else does. One that joins late is told the state, the
    characters and the newest pose and cues of each. Call :meth:`poll` at least a few times a second: it
    answers viewers and sends the heartbeat. Use it as a context manager, or :meth:`close` it.

    Args:
        name: of the edge; one of each on a machine.
        host: the address to listen on, "0.0.0.0" for all.
        pose_port: of the streams; 0 picks a free one.
        control_port: of the requests; 0 picks a free one.

    Attributes:
        name: as given.
        instance: random, for this start of the edge.
        endpoint: where viewers find it, with the actual ports.
        clamped: transforms so far that were not finite or too large, and had to be changed.

    Raises:
        ResourceError: for a port in use, an address that is not of this machine, or a name in use.
    """

    def __init__(
        self,
        *,
        name: str = "edge",
        host: str = "127.0.0.1",
        pose_port: int = POSE_PORT,
        control_port: int = CONTROL_PORT,
    ) -> None:
        self.name, self.instance = name[:64] or "edge", secrets.randbits(32)
        self.clamped = 0
        self._lock = NameLock(self.name)
        self._context: zmq.Context[Any] = zmq.Context()
        self._stream = make_socket(self._context, zmq.PUB, REQUEST.max_bytes)
        router = make_socket(self._context, zmq.ROUTER, REQUEST.max_bytes + 64)
        # A reply may be a whole character: few of them wait for a viewer that does not read.
        router.setsockopt(zmq.SNDHWM, 64)
        try:
            ports = (
                _bind(self._stream, host, pose_port, "--port"),
                _bind(router, host, control_port, "--control-port"),
            )
        except ResourceError:
            self.close()
            raise
        shown = "127.0.0.1" if host in ("0.0.0.0", "*", "") else "::1" if host == "::" else host
        self.endpoint = Endpoint(shown, *ports)
        self._control = Control(router, self._answer)
        self._characters: dict[str, tuple[int, PoseCodec]] = {}
        self._packed: dict[str, CharacterMessage] = {}
        self._sequences: dict[str, int] = {}
        self._latest: dict[tuple[str, str], bytes] = {}
        self._status = StatusMessage(self.name, self.instance, 0, 0)
        self._last_beat = -math.inf

    @property
    def viewers(self) -> int:
        """How many viewers the streams reach, as far as was heard in the last seconds."""
        return self._control.viewers

    @property
    def malformed(self) -> int:
        """Requests that could not be read."""
        return self._control.rejects.total

    @property
    def status(self) -> StatusMessage:
        """What the next heartbeat says."""
        return self._status

    def set_character(self, character: Character) -> int:
        """A new character, or a new version of the one with its id; viewers fetch it by themselves.

        Returns:
            its revision: 1, 2, ...

        Raises:
            InputError: for a character that is larger than the wire carries; what was there stays.
        """
        codec = PoseCodec(character)
        # The first use compiles the codec, which must not happen in the middle of a performance.
        codec.decode(codec.encode(character.rest_pose()).data)
        revision = self.revision(character.id) + 1
        self._packed[character.id] = character_to_message(character, revision)
        self._characters[character.id] = (revision, codec)
        self._state_changed()
        return revision

    def remove_character(self, character: str) -> None:
        """Forget a character; viewers drop it."""
        if self._characters.pop(character, None) is not None:
            self._packed.pop(character, None)
            self._latest = {k: v for k, v in self._latest.items() if k[1] != character}
            self._state_changed()

    def revision(self, character: str) -> int:
        """The revision of a character, 0 where there is none of that id."""
        return self._characters[character][0] if character in self._characters else 0

    def publish_pose(self, pose: Pose, captured_ns: int = 0) -> PoseMessage:
        """Quantise, number and send a pose of a character that was set.

        Args:
            captured_ns: ``time.time_ns()`` when the frame was read.

        Returns:
            what was sent, for a recorder.

        Raises:
            InputError: where the pose has another number of transforms than its character.
            KeyError: for a character that was not set.
        """
        revision, codec = self._characters[pose.character]
        encoded = codec.encode(pose)
        if encoded.clamped and not self.clamped:
            log.warning(
                "%d transforms of %s were not finite or too large; more are only counted",
                encoded.clamped,
                pose.character,
            )
        self.clamped += encoded.clamped
        sequence = self._sequences.get(pose.character, -1) + 1
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
        """Send a stream message (poses go by :meth:`publish_pose`); the bytes that a viewer gets."""
        topic, data = BY_TYPE[type(message)], pack_stream(message)
        if topic.latched:
            self._latest[topic.name, topic.key(message)] = data
        # PUB drops for the viewer whose queue is full; it has no other reason to wait.
        self._stream.send(data, zmq.DONTWAIT)
        return len(data)

    def set_status(self, **fields: Any) -> None:
        """Change fields of the heartbeat (sensor, phase, note, fps, latency_p50_ms, latency_p99_ms,
        performers, dropped, health); a new phase goes out at once."""
        clean = {k: _clean(v) for k, v in fields.items()}
        before, self._status = self._status, msgspec.structs.replace(self._status, **clean)
        if before.phase != self._status.phase:
            self.beat()

    def poll(self) -> list[Command]:
        """Answer viewers, send the heartbeat when it is due; the commands are left to the caller."""
        if time.monotonic() - self._last_beat >= 1 / STATUS.rate_hz:
            self.beat()
        return self._control.poll()

    def beat(self) -> None:
        """Send the heartbeat now."""
        self._last_beat = time.monotonic()
        self._status = msgspec.structs.replace(self._status, published_ns=time.time_ns())
        self.publish(self._status)

    def close(self, linger: float = 1.0) -> None:
        """Let the ports and the name go; what is queued is still sent, for ``linger`` seconds at most."""
        self._context.destroy(linger=int(linger * 1000))
        self._lock.close()

    def __enter__(self) -> Publisher:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _state_changed(self) -> None:
        """Tell viewers to ask again."""
        self._status = msgspec.structs.replace(self._status, revision=self._status.revision + 1)
        self.beat()

    def _answer(self, request: Ask) -> Answer:
        """The reply to everything but a command."""
        match request:
            case Hello():
                if not request.listening:
                    self.beat()
                known = [Revision(name, held[0]) for name, held in self._characters.items()]
                return Welcome(self._status, known, list(self._latest.values()))
            case GetState():
                missing = Refused(f"there is no character {request.character!r}")
                return self._packed.get(request.character, missing)
            case Ping():
                if not request.listening:
                    self.beat()
                return Pong(request.sent_ns, time.time_ns())
            case _:
                return Refused("this is not a request for the edge")


def _clean(value: Any) -> Any:
    """A status field as the wire takes it: finite numbers, short strings."""
    if isinstance(value, float):
        return value if math.isfinite(value) else 0.0
    return value[:200] if isinstance(value, str) else value


def _bind(socket: zmq.Socket[bytes], host: str, port: int, option: str) -> int:
    """Listen; the port, chosen where 0 was asked for."""
    address = {"": "*", "localhost": "127.0.0.1"}.get(host, host)
    try:
        socket.bind(f"tcp://[{address}]:{port}" if ":" in address else f"tcp://{address}:{port}")
    except zmq.ZMQError as error:
        if error.errno == zmq.EADDRINUSE:
            raise ResourceError(
                f"port {port} is in use",
                where=f"{host}:{port}",
                mend=f"Stop the program that uses it, or choose another with {option} (0 picks a free one).",
            ) from None
        raise ResourceError(
            f"cannot listen there ({error.strerror})",
            where=f"{host}:{port}",
            mend="Give an address of this machine with --host, 0.0.0.0 for all of them.",
        ) from None
    last = socket.getsockopt(zmq.LAST_ENDPOINT)
    assert isinstance(last, bytes)
    return int(last.rstrip(b"\0").rpartition(b":")[2])
