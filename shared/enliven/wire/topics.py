"""The table of all network messages.

Sockets, recorder, state for late viewers, receiver, timeline, take player and tests are based on this table.
To add a stream message, add a class in :mod:`enliven.wire.streams` and a row here. To add a request, add a
class, an entry in :data:`enliven.wire.requests.REQUESTS`, and a handler in the edge's list.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from enliven.wire.characters import CharacterMessage
from enliven.wire.fields import MAX_PART_BYTES
from enliven.wire.requests import Reply, Request
from enliven.wire.scans import ScanMessage, ScanPieceMessage
from enliven.wire.streams import (
    BodiesMessage,
    CallMessage,
    CameraMessage,
    CuesMessage,
    HeardMessage,
    HoldMessage,
    MatchesMessage,
    PhysicsMessage,
    PoseMessage,
    PropsMessage,
    SizeMessage,
    StageMessage,
    StatusMessage,
    VoiceMessage,
)


@dataclass(frozen=True)
class Topic:
    """One kind of message.

    Attributes:
        name: name in messages, ASCII.
        type: the message class.
        pattern: direction of the message. "stream" is sent from the edge to every viewer, and "state" to a
            viewer that requests it. "request" is sent from a viewer to its edge, and "reply" is the answer.
        max_bytes: maximum size of the payload in bytes. A longer message is dropped without decoding.
        rate_hz: expected number of messages per second while the edge tracks people. 0 if the rate is
            irregular.
        keep: which queued messages a slow viewer receives: "every" message, or the "newest" of each key.
        latched: True sends the newest message of each key to viewers that join late.
        key: a function that returns a message's key. Messages with equal keys replace each other.
        recorded: True stores it in takes.
    """

    name: str
    type: type[Any]
    pattern: Literal["stream", "state", "request", "reply"]
    max_bytes: int
    rate_hz: float
    keep: Literal["every", "newest"]
    latched: bool = False
    key: Callable[[Any], str] = lambda message: ""
    recorded: bool = False

    @property
    def is_per_character(self) -> bool:
        """True if each message of the topic belongs to one character and is removed with that character."""
        return self.key is _character_id


TOPICS: list[Topic] = []
"""All topics, in order of registration."""
STREAMS: dict[str, Topic] = {}
"""The topics that are sent to every viewer, by name."""
BY_TYPE: dict[type[Any], Topic] = {}
"""All topics by the class of their messages."""


def register(topic: Topic) -> Topic:
    """Adds a topic to the table, and returns it. Call before the sockets are opened."""
    TOPICS.append(topic)
    BY_TYPE[topic.type] = topic
    if topic.pattern == "stream":
        STREAMS[topic.name] = topic
    return topic


def _character_id(message: Any) -> str:
    """Returns the id of a message's character, the key of topics that keep the newest message of each
    character."""
    return str(message.character)


def _register_stream(name: str, kind: type[Any], max_bytes: int, **how: Any) -> Topic:
    """Registers a topic with one message per frame, which takes store."""
    return register(Topic(name, kind, "stream", max_bytes, 30, "every", recorded=True, **how))


POSE = _register_stream("pose", PoseMessage, 260 * 1024, latched=True, key=_character_id)
BODIES = _register_stream("bodies", BodiesMessage, 16 * 1024)
CUES = _register_stream("cues", CuesMessage, 32 * 1024, latched=True, key=_character_id)
PROPS = _register_stream("props", PropsMessage, 32 * 1024, latched=True)
MATCHES = _register_stream("matches", MatchesMessage, 128 * 1024, latched=True, key=_character_id)
HOLDS = register(
    Topic(
        "holds", HoldMessage, "stream", 40 * 1024, 0, "every", latched=True, key=_character_id, recorded=True
    )
)
STAGE = register(Topic("stage", StageMessage, "stream", 128 * 1024, 0, "every", latched=True, recorded=True))
SIZES = register(Topic("sizes", SizeMessage, "stream", 1024, 0, "newest", latched=True, key=_character_id))
SCAN = register(Topic("scan", ScanMessage, "stream", 4 * 1024, 0, "newest", latched=True))
SCAN_PIECE = register(
    Topic(
        *("scan piece", ScanPieceMessage, "stream", 256 * 1024, 0, "newest"),
        latched=True,
        key=lambda message: " ".join(map(str, message.place)),
    )
)
CAMERA = register(Topic("camera", CameraMessage, "stream", 20 * 1024, 0, "newest", latched=True))
CALLS = register(Topic("calls", CallMessage, "stream", 1024, 0, "every"))
HEARD = register(Topic("heard", HeardMessage, "stream", 2 * 1024, 0, "every"))
VOICE = register(Topic("voice", VoiceMessage, "stream", 96 * 1024, 0, "newest", latched=True))
PHYSICS = register(Topic("physics", PhysicsMessage, "stream", 2 * 1024, 0, "newest", latched=True))
STATUS = register(Topic("status", StatusMessage, "stream", 4 * 1024, 2, "newest", False, lambda m: m.edge))
CHARACTER = register(
    Topic("character", CharacterMessage, "state", 128 * 1024 * 1024, 0, "newest", recorded=True)
)
REQUEST = register(Topic("request", Request, "request", 4 * 1024 + MAX_PART_BYTES, 0, "every"))
REPLY = register(Topic("reply", Reply, "reply", 128 * 1024 * 1024, 0, "every"))

MAX_STREAM_BYTES = 64 + max(t.max_bytes for t in STREAMS.values())
"""Maximum bytes of a message on the stream socket, including the envelope."""
