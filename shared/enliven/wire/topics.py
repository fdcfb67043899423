"""The one table of all messages on the wire; sockets, recorder and tests derive from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from enliven.wire.characters import CharacterMessage
from enliven.wire.requests import Reply, Request
from enliven.wire.streams import (
    BodiesMessage,
    CuesMessage,
    MatchesMessage,
    PoseMessage,
    PropsMessage,
    StatusMessage,
)


@dataclass(frozen=True)
class Topic:
    """One kind of message.

    Attributes:
        name: on the wire, ASCII.
        type: the message class.
        way: "stream" goes from the edge to every viewer, "state" to one that asks for it, "request" from a
            viewer to its edge, "reply" back.
        max_bytes: of the payload; a longer message is dropped unread.
        rate_hz: how often it is expected while the edge works; 0: whenever there is a reason.
        keep: the queued messages that a slow viewer gets: "every" one, or the "newest" of each key.
        latched: the newest of each key is also told to a viewer that joins late.
        key: messages with an equal key replace each other.
    """

    name: str
    type: type[Any]
    way: Literal["stream", "state", "request", "reply"]
    max_bytes: int
    rate_hz: float
    keep: Literal["every", "newest"]
    latched: bool = False
    key: Callable[[Any], str] = lambda message: ""


POSE = Topic("pose", PoseMessage, "stream", 260 * 1024, 30, "every", True, lambda m: m.character)
BODIES = Topic("bodies", BodiesMessage, "stream", 16 * 1024, 30, "every")
CUES = Topic("cues", CuesMessage, "stream", 32 * 1024, 30, "every", True, lambda m: m.character)
PROPS = Topic("props", PropsMessage, "stream", 32 * 1024, 30, "every", True)
MATCHES = Topic("matches", MatchesMessage, "stream", 128 * 1024, 30, "every", True, lambda m: m.character)
STATUS = Topic("status", StatusMessage, "stream", 4 * 1024, 2, "newest", False, lambda m: m.edge)
CHARACTER = Topic(
    "character", CharacterMessage, "state", 128 * 1024 * 1024, 0, "newest", False, lambda m: m.id
)
REQUEST = Topic("request", Request, "request", 4 * 1024, 0, "every")
REPLY = Topic("reply", Reply, "reply", 128 * 1024 * 1024, 0, "every")

TOPICS: tuple[Topic, ...] = (POSE, BODIES, CUES, PROPS, MATCHES, STATUS, CHARACTER, REQUEST, REPLY)
STREAMS: dict[str, Topic] = {t.name: t for t in TOPICS if t.way == "stream"}
BY_TYPE: dict[type[Any], Topic] = {t.type: t for t in TOPICS}
MAX_STREAM_BYTES = 64 + max(t.max_bytes for t in STREAMS.values())
"""Bytes of the longest message on the stream socket, envelope included."""
