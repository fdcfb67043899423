"""The connection to one edge. It handles late starts, silence, restarts and version mismatches."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import zmq

from enliven.errors import EnlivenError, InputError
from enliven.peers.clock_probe import ClockProbe
from enliven.wire import (
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
    PoseMessage,
    Refused,
    RejectCounter,
    StatusMessage,
    Topic,
    Welcome,
    check_request,
    message_to_pose,
    unpack_stream,
)
from enliven_viewer.link.bounded_containers import BoundedQueue
from enliven_viewer.link.clock import ClockEstimate
from enliven_viewer.link.edge_characters import MAX_UNREAD_BYTES, EdgeCharacters
from enliven_viewer.link.received_data import Health, Notice, ReceivedPose
from enliven_viewer.link.received_values import MAX_STORED_FRAMES, ReceivedValues
from enliven_viewer.link.requests import Requests
from enliven_viewer.link.stage_link import StageLink
from enliven_viewer.link.stream_socket import StreamSocket
from enliven_viewer.link.topic_health import SILENCE_TIMEOUT_S, TopicHealth, TopicWatch
from enliven_viewer.link.topic_tracks import find_track, relabel_character

POLL_BUDGET_S = 0.01
"""Maximum time in seconds that one poll spends on messages, so that many messages do not block drawing."""
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
NO_ANSWER_TEXT = "does not answer"
"""Last words of the refusal text of a command that timed out. A busy edge may still execute the command."""
_COMMAND_TIMEOUT_S = 3.0
"""Timeout of a command, in seconds. After that, a notice reports that the edge does not answer."""


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
        values: the received values.
        characters: the edge's characters.
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
        self.role = ""
        keys = endpoint.find_keys()
        self._requests = Requests(context, endpoint, keys)
        self._stream = StreamSocket(context, endpoint, keys, self._report_access, self._requests.reopen)
        self._rejects = RejectCounter(f"edge at {endpoint}")
        self.status: StatusMessage | None = None
        self.values = ReceivedValues()
        self.characters = EdgeCharacters(self._label_character)
        self._watches: dict[str, TopicWatch] = {}
        self.instance: int | None = None
        self.clash = False
        self._lost = 0
        self._other_version: int | None = None
        self.last_heard = self._ping_at = -math.inf
        self._unsure: BoundedQueue[bytes] = BoundedQueue(MAX_STORED_FRAMES, MAX_UNREAD_BYTES)
        self._has_reported_full = False
        self._after_silence = True
        self._has_reported_listening = False
        self.stage = StageLink(self)
        self._begin_instance(None)

    def poll(self) -> None:
        """Processes received messages and requests missing data. Does not block."""
        self._stream.watch_handshake()
        self._requests.poll(self._reject)
        deadline = time.monotonic() + POLL_BUDGET_S
        while time.monotonic() < deadline:
            data = self._stream.receive()
            if data is None:
                break
            self.receive(data, latched=False)
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
        hz = poses.hz * max(len(self.values.latest.get(POSE.name, {})), 1)
        return Health(state, text, hz, self._rejects.total, self._lost)

    def topics(self) -> dict[str, TopicHealth]:
        """Returns the health of each topic, by name."""
        fps = self.status.fps if self.status else 0.0
        return {name: self._get_topic_watch(topic).health(fps) for name, topic in STREAMS.items()}

    def ask(self, order: Order, on_reply: Callable[[Answer], None] | None) -> None:
        """Sends an order. A refusal becomes a notice. ``on_reply`` receives the reply."""

        def replied(answer: Answer | None) -> None:
            answer = answer or Refused(f"{self.name} {NO_ANSWER_TEXT}")
            if isinstance(answer, Refused) and answer.reason != SUPERSEDED:
                self._notify(Notice("warning", answer.reason))
            if on_reply is not None:
                on_reply(answer)

        try:
            check_request(order)
        except InputError as error:
            replied(Refused(str(error)[:400]))
            return
        if not self._requests.send(order, "command", _COMMAND_TIMEOUT_S, replied):
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
        return self.characters.wanted.get(character, 0)

    @property
    def has_all_characters(self) -> bool:
        """Returns True if the edge's list of characters is known and all of them have been received."""
        is_list_current = self.status is not None and self._known_revision == self.status.revision
        return is_list_current and self.characters.is_complete

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
        return self._stream.socket

    def close(self) -> None:
        """Closes the sockets."""
        if self.probe is not None:
            self.probe.close()
            self.probe = None
        self.stage.close()
        self._requests.close()
        self._stream.close()

    def _report_access(self, text: str) -> None:
        """Notifies the user of a problem with the keys."""
        self._notify(Notice("error", text))

    def _label_character(self, character: str) -> str:
        """Returns the id in this viewer of a character of the edge."""
        return self._label(self.name, character)

    def _state(self, now: float, poses: TopicHealth) -> tuple[Any, str]:
        """Returns the state and the text of :class:`Health`."""
        if self._other_version is not None:
            return "version mismatch", (
                f"the edge at {self.endpoint} uses version {self._other_version} of the network protocol, "
                "but this viewer uses another version: install the same release of enliven on both"
            )
        if self._stream.problem:
            return "no access", self._stream.problem
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
        self._sequences: dict[str, int] = {}
        self.characters.begin_instance()
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

    def receive(self, data: bytes, latched: bool) -> None:
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
            elif self.status is not None and self.characters.accepts(topic, message):
                own_message = relabel_character(message, self._label_character)
                track = find_track(topic)
                value = track.read(own_message, self.name)
                self.values.store(topic, topic.key(own_message), value, track.size_of(len(data)))
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
        self.last_heard, self._other_version, self._stream.problem = now, None, ""

    def _process_held_back(self) -> None:
        """Processes the queued messages that arrived after a silence, before the sending
        process was known.
        """
        self._after_silence = False
        # If this thread is suspended meanwhile, messages are queued again. So the queue may not be empty at
        # the end.
        for data in self._unsure.take_all():
            self.receive(data, latched=False)

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
        self.characters.accepts(POSE, message)
        last = self._sequences.get(message.character)
        if last is not None and (latched or message.sequence <= last):
            return
        if not latched:
            self._sequences[message.character] = message.sequence
            self._lost += message.sequence - last - 1 if last is not None else 0
        self._decode(message, time.time_ns())

    def _decode(self, message: PoseMessage, received_ns: int) -> None:
        held = self.characters.find(message, received_ns)
        if held is None:
            return
        character_id = held.character.id
        pose = replace(message_to_pose(message, held.codec), character=character_id)
        times = (message.captured_ns, message.published_ns, received_ns, self.clock_offset_ns)
        size = pose.linear.nbytes + pose.positions.nbytes
        received = ReceivedPose(pose, self.name, message.sequence, *times, held.character, message.revision)
        self.values.store(POSE, character_id, received, size)
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
        for character in self.characters.list_missing(now, interval):
            self._request_character(character, now)

    def _request_character(self, character: str, now: float) -> None:
        key = f"character {character}\0"
        has_capacity = self._requests.count_pending("character ") < _MAX_PARALLEL_REQUESTS
        if has_capacity and not self._requests.count_pending(key):
            self.characters.record_request(character, now)
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
        self.values.forget_unlisted(self.characters.set_list(answer.characters))
        listed = self.characters.wanted
        self._sequences = {name: last for name, last in self._sequences.items() if name in listed}
        for message in answer.latest:
            self.receive(message, latched=True)

    def _handle_character(self, answer: Answer | None) -> None:
        """Stores a character and decodes its queued poses. If the new revision is unusable, the old one
        stays.
        """
        if not isinstance(answer, CharacterMessage) or answer.id not in self.characters.wanted:
            return
        try:
            is_held = self.characters.add(answer, time.monotonic())
        except (EnlivenError, ValueError) as error:
            self._rejects.add(error)
            return
        if not is_held:
            self._report_full_memory()
            return
        for message, received_ns in self.characters.waiting.take_all():
            try:
                self._decode(message, received_ns)
            except ValueError as error:
                self._rejects.add(error)

    def _report_full_memory(self) -> None:
        """Notifies the user once that not all characters fit into memory."""
        if not self._has_reported_full:
            self._has_reported_full = True
            self._notify(Notice("warning", self.characters.describe_limit(self.name)))
