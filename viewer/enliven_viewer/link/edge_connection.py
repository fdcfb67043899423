"""The connection to one edge. It handles late starts, silence, restarts and version mismatches."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import zmq
from msgspec.structs import astuple

from enliven.document import Character
from enliven.errors import EnlivenError, InputError
from enliven.keys.client import ClientKeys, HandshakeMonitor, handshake_advice
from enliven.peers.clock_probe import ClockProbe
from enliven.wire import (
    MAX_STREAM_BYTES,
    MAX_UNREAD_STREAMS,
    POSE,
    STATUS,
    STREAMS,
    SUPERSEDED,
    Answer,
    Ask,
    CharacterMessage,
    Endpoint,
    GetState,
    Hello,
    MalformedMessageError,
    Order,
    OtherVersionError,
    Ping,
    Pong,
    PoseCodec,
    PoseMessage,
    Refused,
    RejectCounter,
    StatusMessage,
    Topic,
    Welcome,
    check_request,
    make_socket,
    message_to_character,
    message_to_pose,
    unpack_stream,
)
from enliven_viewer.link.bounded_containers import BoundedQueue, NewestValues
from enliven_viewer.link.clock import ClockEstimate
from enliven_viewer.link.received_data import Health, Notice, ReceivedPose
from enliven_viewer.link.requests import Requests
from enliven_viewer.link.stage_link import StageLink
from enliven_viewer.link.topic_health import SILENCE_TIMEOUT_S, TopicHealth, TopicWatch
from enliven_viewer.link.topic_tracks import find_track, relabel_character

_POLL_BUDGET_S = 0.01
"""Maximum time in seconds that one poll spends on messages, so that many messages do not block drawing."""
_MAX_STORED_FRAMES = 4000
"""Maximum number of unfetched poses, and of unfetched frames of bodies: two minutes of one character."""
_MAX_STORED_BYTES = 64 * 1024 * 1024
"""Maximum size of a topic's unfetched values in bytes: two minutes of poses of a graph with 1,000 nodes."""
_MAX_UNREAD_BYTES = 16 * 1024 * 1024
"""Maximum size in bytes of messages that are queued until their character has arrived, or until the sending
process is known.
"""
_MAX_KEYS = 4096
"""Maximum number of keys of a topic, such as the blocks of a scan. The newest value of each key is stored. An
edge sends no more keys than this.
"""
_MAX_NEWEST_BYTES = 128 * 1024 * 1024
"""Maximum size of a topic's newest values in bytes. The blocks of a scanned room take about 40 MB."""
_MAX_UNKNOWN_CHARACTERS = 64
"""Maximum number of characters in messages that the edge has not listed yet: four times the capacity of a
stage.
"""
_MAX_CHARACTER_BYTES = 512 * 1024 * 1024
"""Maximum size of all characters of an edge in bytes: enough for four characters of two million vertices
each.
"""
_REQUEST_INTERVAL_S = 1.0
"""Seconds between two identical requests once stream messages arrive."""
_FIRST_REQUEST_INTERVAL_S = 0.1
"""Seconds between two requests before the first stream message. Each request makes the edge publish a
heartbeat.
"""
_REPLY_TIMEOUT_S = 1.0
"""Timeout in seconds of a hello (login) or a ping. An edge answers within a frame."""
_CHARACTER_TIMEOUT_S = 10.0
"""Timeout in seconds of a character request, which may transfer megabytes over a slow network."""
_MAX_PARALLEL_REQUESTS = 4
"""Maximum number of simultaneous character requests, so that poses and heartbeats are not delayed."""
_FULL_RETRY_INTERVAL_S = 30.0
"""Seconds until a character that exceeds the memory limit is requested again."""
NO_ANSWER_TEXT = "does not answer"
"""Last words of the refusal text of a command that timed out. A busy edge may still execute the command."""
_REOPEN_INTERVAL_S = 2.0
"""Seconds from a failed handshake to the next attempt. In the meantime the user may pair with the edge."""
_COMMAND_TIMEOUT_S = 3.0
"""Timeout of a command, in seconds. After that, a notice reports that the edge does not answer."""


@dataclass(frozen=True)
class _HeldCharacter:
    revision: int
    character: Character
    codec: PoseCodec
    size: int


class EdgeConnection:
    """A ZeroMQ SUB and a DEALER socket to one edge, and the received messages. An EdgeClient polls it.

    Args:
        endpoint: address of the edge, which need not be running yet.
        viewer: name of this viewer, sent in the hello.
        label: returns a character's id in this viewer, given the edge's name and the id on the edge.
        notify: called with notices for the user.
        forward: called with each accepted stream message, unchanged, for programs that relay messages. A pose
            is forwarded once its character is known.

    Attributes:
        inbox: the unfetched values by topic. The topic's ``keep`` determines whether these are all values or
            only the newest of each key.
        latest: the newest value by topic and key.
        stage: link that puts characters onto the edge's stage.
        probe: measures the edge's clock precisely, see :meth:`align_clock`. None if only the coarse estimate
            :attr:`clock` is used.
        role: this viewer's role on the edge, empty before its first answer.

    Raises:
        InputError: if a key file is damaged, or others may read it.
    """

    def __init__(
        self,
        context: zmq.Context[Any],
        endpoint: Endpoint,
        viewer: str,
        label: Callable[[str, str], str],
        notify: Callable[[Notice], None],
        forward: Callable[[Any], None] = lambda message: None,
    ) -> None:
        self._forward = forward
        self.endpoint, self.clock = endpoint, ClockEstimate()
        self.probe: ClockProbe | None = None
        self._viewer, self._label, self._notify = viewer, label, notify
        self._context, self.role = context, ""
        self._access_problem, self._reopen_at = "", math.inf
        keys = endpoint.find_keys()
        self._open_stream(keys)
        self._requests = Requests(context, endpoint, keys)
        self._rejects = RejectCounter(f"edge at {endpoint}")
        self.status: StatusMessage | None = None
        self.held: dict[str, _HeldCharacter] = {}
        self.inbox: dict[str, BoundedQueue[Any] | NewestValues] = {}
        self.latest: dict[str, NewestValues] = {}
        self._watches: dict[str, TopicWatch] = {}
        self.instance: int | None = None
        self.clash = False
        self._lost = 0
        self._other_version: int | None = None
        self.last_heard = self._ping_at = -math.inf
        self._unsure: BoundedQueue[bytes] = BoundedQueue(_MAX_STORED_FRAMES, _MAX_UNREAD_BYTES)
        self._has_reported_full = False
        self._after_silence = True
        self._has_reported_listening = False
        self.stage = StageLink(self)
        self._begin_instance(None)

    def poll(self) -> None:
        """Processes received messages and requests missing data. Does not block."""
        self._watch_handshake()
        self._requests.poll(self._reject)
        deadline = time.monotonic() + _POLL_BUDGET_S
        while time.monotonic() < deadline:
            try:
                parts = self._stream.recv_multipart(zmq.DONTWAIT)
            except zmq.Again:
                break
            self._receive(b"".join(parts), latched=False)
        self._request_missing_data()
        self.stage.poll()

    @property
    def name(self) -> str:
        """Returns the edge's name, or its address before the first message."""
        return self.status.edge if self.status else str(self.endpoint)

    def health(self) -> Health:
        """Returns the health of the edge."""
        now = time.monotonic()
        poses = self._get_topic_watch(POSE).health(self.status.fps if self.status else 0.0)
        state, text = self._state(now, poses)
        hz = poses.hz * max(len(self.latest.get(POSE.name, {})), 1)
        return Health(state, text, hz, self._rejects.total, self._lost)

    def topics(self) -> dict[str, TopicHealth]:
        """Returns the health of each topic, by name."""
        fps = self.status.fps if self.status else 0.0
        return {name: self._get_topic_watch(topic).health(fps) for name, topic in STREAMS.items()}

    def send_command(self, request: Order, on_reply: Callable[[Answer], None] | None) -> None:
        """Sends a command. A refusal becomes a notice. ``on_reply`` receives the reply."""

        def replied(answer: Answer | None) -> None:
            answer = answer or Refused(f"{self.name} {NO_ANSWER_TEXT}")
            if isinstance(answer, Refused) and answer.reason != SUPERSEDED:
                self._notify(Notice("warning", answer.reason))
            if on_reply is not None:
                on_reply(answer)

        try:
            check_request(request)
        except InputError as error:
            replied(Refused(str(error)[:400]))
            return
        if not self._requests.send(request, "command", _COMMAND_TIMEOUT_S, replied):
            replied(Refused(f"no edge answers at {self.endpoint}"))

    def request(self, body: Ask, seconds: float, on_reply: Callable[[Answer | None], None]) -> bool:
        """Sends a request.

        Calls back with the answer, or with None after the timeout. Returns False without an edge.
        """
        return self._requests.send(body, "stage", seconds, on_reply)

    def revision(self, character: str) -> int:
        """Returns the revision of a character by its id on the edge, or 0 if the edge does not have the
        character.
        """
        return self._wanted.get(character, 0)

    @property
    def has_all_characters(self) -> bool:
        """Returns True if the edge's list of characters is known and all of them have been received."""
        is_list_current = self.status is not None and self._known_revision == self.status.revision
        return is_list_current and self._revisions == self._wanted

    def align_clock(self) -> None:
        """Starts to measure the edge's clock, to a fraction of a millisecond on a wired network. The
        measurement needs a separate thread and connection, so use it only with several edges.
        """
        if self.probe is None:
            self.probe = ClockProbe(self.endpoint, self._viewer)

    @property
    def clock_offset_ns(self) -> int:
        """Returns the best estimate of the edge's wall clock minus this machine's, in nanoseconds."""
        if self.probe is not None and self.probe.is_known:
            return self.probe.wall_offset_ns()
        return self.clock.offset_ns

    @property
    def socket(self) -> zmq.Socket[bytes]:
        """Returns the SUB socket of the streams. Callers may only poll it. It is replaced when the keys
        change.
        """
        return self._stream

    def close(self) -> None:
        """Closes the sockets."""
        if self.probe is not None:
            self.probe.close()
            self.probe = None
        self.stage.close()
        self._requests.close()
        self._close_stream()

    def _open_stream(self, keys: ClientKeys | None) -> None:
        """Opens the SUB socket and connects it to the edge's streams."""
        self._stream = make_socket(self._context, zmq.SUB, MAX_STREAM_BYTES, MAX_UNREAD_STREAMS, keys)
        self._handshake = HandshakeMonitor(self._stream, keys is not None)
        self._stream.setsockopt(zmq.SUBSCRIBE, b"")
        self._stream.connect(self.endpoint.stream_address)

    def _close_stream(self) -> None:
        self._handshake.close()
        self._stream.close(linger=0)

    def _watch_handshake(self) -> None:
        """Reports a failed handshake. Reconnects later, because libzmq does not retry after wrong keys."""
        self._handshake.poll()
        problem, now = self._handshake.problem, time.monotonic()
        if problem and self._reopen_at == math.inf:
            self._reopen_at = now + _REOPEN_INTERVAL_S
            advice = handshake_advice(problem, self.endpoint.host)
            self._report_access(f"the edge at {self.endpoint} {advice}")
        elif now >= self._reopen_at:
            self._reopen_at = math.inf
            try:
                keys = self.endpoint.find_keys()
            except EnlivenError as error:
                self._reopen_at = now + _REOPEN_INTERVAL_S
                self._report_access(str(error))
                return
            self._close_stream()
            self._open_stream(keys)
            self._requests.reopen(keys)

    def _report_access(self, text: str) -> None:
        """Notifies the user of a problem with the keys, once per problem."""
        if text != self._access_problem:
            self._access_problem = text
            self._notify(Notice("error", text))

    def _state(self, now: float, poses: TopicHealth) -> tuple[Any, str]:
        """Returns the state and the text of :class:`Health`."""
        if self._other_version is not None:
            return "version mismatch", (
                f"the edge at {self.endpoint} uses version {self._other_version} of the network protocol, "
                "but this viewer uses another version: install the same release of enliven on both"
            )
        if self._access_problem:
            return "no access", self._access_problem
        if self.status is None:
            return "waiting", f"waiting for an edge at {self.endpoint}"
        if self.clash:
            return "name clash", f"two edges are named {self.name!r}: start one of them with another --name"
        if self.status.phase == "ended":
            return "ended", f"{self.name}: the camera or recording has ended"
        silent = now - self.last_heard
        if silent > SILENCE_TIMEOUT_S or self._after_silence:
            return "stale", f"{self.name} has sent nothing for {silent:.0f} s"
        if poses.on_rate:
            return "on rate", f"{self.name}: {self.status.phase}"
        return "connected", f"{self.name}: {self.status.phase}"

    def _begin_instance(self, instance: int | None) -> None:
        """Resets counters and requests after the edge was started or restarted. The known characters stay on
        the screen until the new process has sent its list.
        """
        self.instance = instance
        self._known_revision = -1
        self._revisions: dict[str, int] = {}
        self._sequences: dict[str, int] = {}
        self._unknown: set[str] = set()
        self._waiting: BoundedQueue[tuple[PoseMessage, int]] = BoundedQueue(
            _MAX_STORED_FRAMES, _MAX_UNREAD_BYTES
        )
        self._wanted: dict[str, int] = {}
        self._asked_at: dict[str, float] = {}
        self._hello_at = -math.inf
        self._requests.forget()
        self.stage.restart()

    def _reject(self, error: MalformedMessageError) -> None:
        """Counts a message that cannot be read. Notifies the user if it uses another protocol version."""
        if isinstance(error, OtherVersionError) and self._other_version != error.version:
            self._other_version = error.version
            self._notify(Notice("error", self._state(0.0, TopicHealth())[1]))
        if error.kind in STREAMS:
            self._get_topic_watch(STREAMS[error.kind]).count_failure()
        self._rejects.add(error)

    def _receive(self, data: bytes, latched: bool) -> None:
        """Processes one stream message. Drops it if it is inconsistent."""
        try:
            topic, message = unpack_stream(data)
            if not latched:
                self._record_arrival(topic)
            if topic is STATUS:
                self._handle_status(message)
            elif topic is POSE:
                self._handle_pose(message, latched)
            elif self._after_silence and not latched:
                self._unsure.append(data, len(data))
                return
            elif self.status is not None and self._accepts_message(topic, message):
                own_message = relabel_character(message, lambda character: self._label(self.name, character))
                track = find_track(topic)
                self._store_value(
                    topic,
                    topic.key(own_message),
                    track.read(own_message, self.name),
                    track.size_of(len(data)),
                )
                self._forward(message)
            if not latched:
                self._get_topic_watch(topic).count_message(topic.key(message))
            if self._after_silence and not latched:
                self._process_held_back()
        except MalformedMessageError as error:
            self._reject(error)
        except (EnlivenError, ValueError) as error:
            self._get_topic_watch(topic).count_failure()
            self._rejects.add(error)

    def _record_arrival(self, topic: Topic) -> None:
        """Records that the edge is alive. After a silence, only a status or pose message can show whether the
        edge has restarted, because only these identify the process.
        """
        now = time.monotonic()
        self._after_silence |= now - self.last_heard > SILENCE_TIMEOUT_S
        self.last_heard, self._other_version, self._access_problem = now, None, ""

    def _process_held_back(self) -> None:
        """Processes the queued messages that arrived after a silence, before the sending
        process was known.
        """
        self._after_silence = False
        # If this thread is suspended meanwhile, messages are queued again. So the queue may not be empty at
        # the end.
        for data in self._unsure.take_all():
            self._receive(data, latched=False)

    def _accepts_message(self, topic: Topic, message: Any) -> bool:
        """Returns True if a message is about a listed character, or about one of a few unlisted ones."""
        if (
            not topic.is_per_character
            or message.character in self._wanted
            or message.character in self._unknown
        ):
            return True
        if len(self._unknown) >= _MAX_UNKNOWN_CHARACTERS:
            raise MalformedMessageError(
                topic.name, "the message is about a character that the edge does not list"
            )
        self._unknown.add(message.character)
        return True

    def _store_value(self, topic: Topic, key: str, value: Any, size: int) -> None:
        """Stores a value of ``size`` bytes in the inbox for the caller, and as the newest value
        of its key.
        """
        if topic.name not in self.inbox:
            # Keep only the newest camera image. A caller that never fetches them, such as a kiosk, would
            # otherwise store thousands.
            self.inbox[topic.name] = (
                BoundedQueue(_MAX_STORED_FRAMES, _MAX_STORED_BYTES)
                if topic.keep == "every"
                else NewestValues(_MAX_KEYS, _MAX_NEWEST_BYTES)
            )
            self.latest[topic.name] = NewestValues(_MAX_KEYS, _MAX_NEWEST_BYTES)
        self.latest[topic.name].set_newest(key, value, size)
        inbox = self.inbox[topic.name]
        if isinstance(inbox, NewestValues):
            inbox.set_newest(key, value, size)
        else:
            inbox.append(value, size)

    def _get_topic_watch(self, topic: Topic) -> TopicWatch:
        """Returns the message counter of a topic."""
        return self._watches.setdefault(topic.name, TopicWatch(topic))

    def _handle_status(self, message: StatusMessage) -> None:
        if message.instance != self.instance:
            if self.instance is not None:
                self._notify(Notice("info", f"{message.edge} has restarted"))
            self._begin_instance(message.instance)
        self.status = message
        self.clock.add_heartbeat(message.published_ns, time.time_ns())
        if message.revision != self._known_revision:
            self._hello_at = -math.inf

    def _handle_pose(self, message: PoseMessage, latched: bool) -> None:
        """Checks a pose's sequence number, and decodes the pose now or once its character has arrived."""
        if message.instance != self.instance:
            if latched:
                return
            self._begin_instance(message.instance)
        self._accepts_message(POSE, message)
        last = self._sequences.get(message.character)
        if last is not None and (latched or message.sequence <= last):
            return
        if not latched:
            self._sequences[message.character] = message.sequence
            self._lost += message.sequence - last - 1 if last is not None else 0
        self._decode(message, time.time_ns())

    def _decode(self, message: PoseMessage, received_ns: int) -> None:
        held_revision = self._revisions.get(message.character, 0)
        if held_revision != message.revision:
            if message.revision > held_revision:
                self._waiting.append((message, received_ns), len(message.transforms))
            return
        character_id = self._label(self.name, message.character)
        held_character = self.held[character_id]
        pose = replace(message_to_pose(message, held_character.codec), character=character_id)
        times = (message.captured_ns, message.published_ns, received_ns, self.clock_offset_ns)
        revision_of_pose = held_character.character, message.revision
        size = pose.linear.nbytes + pose.positions.nbytes
        self._store_value(
            POSE,
            character_id,
            ReceivedPose(pose, self.name, message.sequence, *times, *revision_of_pose),
            size,
        )
        self._forward(message)

    def _request_missing_data(self) -> None:
        """Sends a hello until it is answered, and requests missing characters and the time."""
        now = time.monotonic()
        listening = now - self.last_heard < SILENCE_TIMEOUT_S
        # Until the streams arrive, every request triggers a heartbeat of the edge, so ask more often.
        interval = _REQUEST_INTERVAL_S if listening else _FIRST_REQUEST_INTERVAL_S
        is_outdated = self.status is None or self.status.revision != self._known_revision
        if is_outdated and now - self._hello_at >= interval and not self._requests.count_pending("hello"):
            hello = Hello(self._viewer, listening)
            if self._requests.send(hello, "hello", _REPLY_TIMEOUT_S, self._handle_welcome):
                self._hello_at = now
        elif now - self._ping_at >= interval or listening != self._has_reported_listening:
            ping = Ping(self._viewer, time.time_ns(), listening)
            if self._requests.send(ping, "ping", _REPLY_TIMEOUT_S, self._handle_pong):
                self._ping_at, self._has_reported_listening = now, listening
        for character, revision in self._wanted.items():
            if (
                self._revisions.get(character) != revision
                and now - self._asked_at.get(character, 0.0) > interval
            ):
                self._request_character(character, now)

    def _request_character(self, character: str, now: float) -> None:
        key = f"character {character}\0"
        if self._requests.count_pending(
            "character "
        ) < _MAX_PARALLEL_REQUESTS and not self._requests.count_pending(key):
            self._asked_at[character] = now
            self._requests.send(GetState(character), key, _CHARACTER_TIMEOUT_S, self._handle_character)

    def _handle_pong(self, answer: Answer | None) -> None:
        if isinstance(answer, Pong):
            self.clock.add_ping(answer.sent_ns, answer.edge_ns, time.time_ns())

    def _handle_welcome(self, answer: Answer | None) -> None:
        """Stores the edge's list of characters, and removes those that are no longer listed."""
        if not isinstance(answer, Welcome):
            return
        self.role = answer.role
        self._handle_status(answer.status)
        self._known_revision = answer.status.revision
        listed_revisions = {entry.character: entry.revision for entry in answer.characters}
        self._asked_at = {
            c: t for c, t in self._asked_at.items() if listed_revisions.get(c) == self._wanted.get(c)
        }
        self._wanted = listed_revisions
        listed_ids = {self._label(self.name, character) for character in self._wanted}
        for unlisted_id in [name for name in self.held if name not in listed_ids]:
            del self.held[unlisted_id]
        self._forget_unlisted(listed_ids)
        self._revisions = {
            name: revision for name, revision in self._revisions.items() if name in listed_revisions
        }
        self._sequences = {name: last for name, last in self._sequences.items() if name in listed_revisions}
        self._unknown.clear()
        for message in answer.latest:
            self._receive(message, latched=True)

    def _forget_unlisted(self, listed_ids: set[str]) -> None:
        """Removes the newest messages about characters that the edge does not list."""
        for name, newest in self.latest.items():
            if STREAMS[name].is_per_character:
                for unlisted_id in newest.keys() - listed_ids:
                    newest.forget(unlisted_id)

    def _handle_character(self, answer: Answer | None) -> None:
        """Stores a character and decodes its queued poses. If the new revision is unusable, the old one
        stays.
        """
        if not isinstance(answer, CharacterMessage) or answer.id not in self._wanted:
            return
        character_id = self._label(self.name, answer.id)
        try:
            character = replace(message_to_character(answer), id=character_id)
            codec = PoseCodec(character)
        except (EnlivenError, ValueError) as error:
            self._rejects.add(error)
            return
        size = _count_bytes(answer)
        other_bytes = sum(
            held_character.size for name, held_character in self.held.items() if name != character_id
        )
        if other_bytes + size > _MAX_CHARACTER_BYTES:
            self._asked_at[answer.id] = time.monotonic() + _FULL_RETRY_INTERVAL_S
            self._report_full_memory()
            return
        self.held[character_id] = _HeldCharacter(answer.revision, character, codec, size)
        self._revisions[answer.id] = answer.revision
        for message, received_ns in self._waiting.take_all():
            try:
                self._decode(message, received_ns)
            except ValueError as error:
                self._rejects.add(error)

    def _report_full_memory(self) -> None:
        """Notifies the user once that not all characters fit into memory."""
        if not self._has_reported_full:
            self._has_reported_full = True
            max_megabytes = _MAX_CHARACTER_BYTES // 1024**2
            problem = f"the characters of {self.name} have more than {max_megabytes} MB"
            text = f"{problem}, so some are not shown. Remove some characters from the stage"
            self._notify(Notice("warning", text))


def _count_bytes(message: CharacterMessage) -> int:
    """Returns the number of bytes of a character's arrays and images."""
    parts = [*astuple(message)]
    if message.materials is not None:
        parts += [*astuple(message.materials), *(texture.image for texture in message.materials.textures)]
    return sum(len(part) for part in parts if isinstance(part, bytes))
