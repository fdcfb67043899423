"""The messages between edge and viewer, one class each; a field that came later has a default.

Every message travels as MessagePack in an envelope with :data:`VERSION` (:mod:`enliven.wire.envelope`).
Streams are arrays of their fields in order, requests and replies maps by name; unknown fields are ignored, so
a newer program may append. Types, lengths and finiteness are checked on receipt; nothing is trusted.
Numbers in ``bytes`` are little-endian.
"""

from __future__ import annotations

from enliven.wire.characters import CharacterMessage
from enliven.wire.fields import (
    MAX_FACES,
    MAX_HEALTH,
    MAX_PROPS,
    MAX_TRANSFORM_BYTES,
    MAX_TRANSFORMS,
    MAX_VERTICES,
)
from enliven.wire.requests import (
    SUPERSEDED,
    Answer,
    Ask,
    Awaited,
    Browse,
    CharacterPart,
    Done,
    GetState,
    Hello,
    Lock,
    Look,
    Mode,
    Order,
    Ping,
    Pong,
    Possess,
    PutCharacter,
    Refused,
    Release,
    RemoveCharacter,
    Reply,
    Request,
    Smooth,
    Welcome,
)
from enliven.wire.streams import (
    BodiesMessage,
    CuesMessage,
    HealthMessage,
    MatchesMessage,
    PackedBody,
    PackedMatch,
    PoseMessage,
    PropsMessage,
    Revision,
    StageMessage,
    StatusMessage,
)

VERSION = 1
"""Of the wire. Raised when an old program could misread a new message."""

__all__ = [
    "MAX_FACES",
    "MAX_HEALTH",
    "MAX_PROPS",
    "MAX_TRANSFORMS",
    "MAX_TRANSFORM_BYTES",
    "MAX_VERTICES",
    "SUPERSEDED",
    "VERSION",
    "Answer",
    "Ask",
    "Awaited",
    "BodiesMessage",
    "Browse",
    "CharacterMessage",
    "CharacterPart",
    "CuesMessage",
    "Done",
    "GetState",
    "HealthMessage",
    "Hello",
    "Lock",
    "Look",
    "MatchesMessage",
    "Mode",
    "Order",
    "PackedBody",
    "PackedMatch",
    "Ping",
    "Pong",
    "PoseMessage",
    "Possess",
    "PropsMessage",
    "PutCharacter",
    "Refused",
    "Release",
    "RemoveCharacter",
    "Reply",
    "Request",
    "Revision",
    "Smooth",
    "StageMessage",
    "StatusMessage",
    "Welcome",
]
