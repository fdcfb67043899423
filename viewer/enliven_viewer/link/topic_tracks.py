"""Defines how the messages of each topic are converted and put onto the timeline, live or from a take."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import msgspec

from enliven.wire import (
    BODIES,
    CUES,
    HOLDS,
    MATCHES,
    POSE,
    PROPS,
    STREAMS,
    BodiesMessage,
    CuesMessage,
    HoldMessage,
    Topic,
    message_to_board,
    message_to_bodies,
    message_to_cues,
    message_to_owners,
    message_to_props,
)
from enliven_viewer.link.received_data import ReceivedBodies, ReceivedCues, ReceivedPose
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.timeline import CueFrame

_OBJECT_OVERHEAD_BYTES = 500
"""Overhead of a stored value in bytes, in addition to its numbers: the object, array headers and strings."""


@dataclass(frozen=True)
class TopicTrack:
    """The processing of a topic's messages in the viewer.

    Attributes:
        read: converts (message, the edge's name) to the viewer's own value.
        put: puts a value onto the timeline of a document.
        growth: size of the value in memory relative to the size of the message.
    """

    read: Callable[[Any, str], Any]
    put: Callable[[Document, Any], None]
    growth: int = 1

    def size_of(self, received: int) -> int:
        """Returns the size in bytes of a value from a message of ``received`` bytes."""
        return _OBJECT_OVERHEAD_BYTES + self.growth * received


def _read_bodies(message: BodiesMessage, edge: str) -> ReceivedBodies:
    return ReceivedBodies(edge, message.time_ns, message.captured_ns, tuple(message_to_bodies(message)))


def _read_cues(message: CuesMessage, edge: str) -> ReceivedCues:
    nodes, strengths = message_to_cues(message)
    cue_values = (message.state, nodes, strengths, message.body, message.time_ns)
    return ReceivedCues(message.character, *cue_values, message_to_owners(message), message.held)


def _put_pose(document: Document, received: ReceivedPose) -> None:
    document.add_pose(received.pose, received.character)


def _put_cues(document: Document, cues: ReceivedCues) -> None:
    cue_frame = CueFrame(cues.character, cues.nodes, cues.strengths, cues.state, cues.owners, cues.held)
    document.set_cues(cue_frame, cues.time_ns)


def _put_hold(document: Document, held: HoldMessage) -> None:
    """Puts a change of attachments onto the timeline, at the newest time or later.

    A viewer that joins late also receives old changes, which must not be put into the past.
    """
    now = max(held.time_ns, document.timeline.end_ns)
    document.add(HOLDS, msgspec.structs.replace(held, time_ns=now))


TRACKS: dict[str, TopicTrack] = {
    BODIES.name: TopicTrack(
        _read_bodies, lambda document, seen: document.add_bodies(seen.time_ns, seen.bodies), growth=12
    ),
    POSE.name: TopicTrack(lambda pose, edge: pose, _put_pose),
    PROPS.name: TopicTrack(lambda message, edge: message_to_props(message), Document.add_props, growth=6),
    MATCHES.name: TopicTrack(lambda message, edge: message_to_board(message), Document.add_board, growth=4),
    CUES.name: TopicTrack(_read_cues, _put_cues, growth=4),
    HOLDS.name: TopicTrack(lambda message, edge: message, _put_hold),
}
"""The tracks by topic. Their order is the order in which simultaneous messages are applied. Poses are decoded
before, together with their character.
"""


def find_track(topic: Topic) -> TopicTrack:
    """Returns the track of a topic. The default track puts messages onto the timeline unchanged."""
    default_track = TopicTrack(
        lambda message, edge: message, lambda document, value: document.add(topic, value)
    )
    return TRACKS.get(topic.name, default_track)


def sort_topics(topics: Iterable[Topic]) -> list[Topic]:
    """Returns topics in the order in which their simultaneous messages are applied."""
    return sorted(topics, key=lambda t: list(TRACKS).index(t.name) if t.name in TRACKS else len(TRACKS))


def list_shown_topics() -> list[Topic]:
    """Returns the topics that takes contain and the timeline shows, in the order in which they
    are applied.
    """
    return sort_topics(topic for topic in STREAMS.values() if topic.recorded)


def relabel_character(message: Any, label: Callable[[str], str]) -> Any:
    """Returns a message with this viewer's id of its character. Messages without a character
    stay unchanged.
    """
    if "character" not in message.__struct_fields__:
        return message
    return msgspec.structs.replace(message, character=label(message.character))
