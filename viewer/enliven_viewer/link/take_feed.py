"""Plays a take from a file: recorded network messages by topic."""

from __future__ import annotations

import heapq
import logging
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec

from enliven.document import Character
from enliven.errors import EnlivenError, InputError
from enliven.files import DAMAGE
from enliven.recording import Recording
from enliven.wire import (
    CHARACTER,
    POSE,
    STREAMS,
    CharacterMessage,
    Order,
    PoseCodec,
    PoseMessage,
    message_to_character,
    message_to_pose,
)
from enliven_viewer.link.topic_tracks import find_track, list_shown_topics
from enliven_viewer.playback.document import Document, EdgeState

log = logging.getLogger(__name__)

_MESSAGES_PER_POLL = 96
"""Maximum number of messages that one poll applies: about a second of a take. So the window can draw while
the take is read.
"""


class TakeFeed:
    """A :class:`~enliven_viewer.link.feed.Feed` that reads the next messages of a take with every poll.

    A message that cannot be read is skipped; the first one is logged. A take contains copies of each
    character. If the first copy is damaged, poses are decoded with another copy of the same revision.

    Raises:
        InputError: if the file is not a recording, or contains no poses.
    """

    def __init__(self, path: Path) -> None:
        recording = Recording(path)
        topic_names = [CHARACTER.name, *(topic.name for topic in list_shown_topics())]
        present_topics = [name for name in topic_names if name in recording.info.topics]
        if not {"character", "pose"} <= set(present_topics):
            raise InputError(
                "the recording contains no performance (characters and poses)",
                where=str(path),
                remedy="Perform a mesh with this recording: enliven run --recording FILE.",
            )
        self.name = path.name
        self.unreadable = 0
        self._recording = recording
        self._messages = _merge_by_time(recording, present_topics)
        self._revisions: dict[str, int] = {}
        self._held: dict[tuple[str, int], tuple[Character, PoseCodec]] = {}
        self._searched: set[tuple[str, int]] = set()
        self._state = EdgeState(connected=True, address=str(path), phase="playing")

    def poll(self, document: Document) -> int:
        """Applies the next messages in order of time. Returns their number, or 0 at the end of the take."""
        count = 0
        for _, topic, data in self._iterate_messages():
            count += 1
            try:
                self._apply(document, topic, data)
            except (msgspec.MsgspecError, EnlivenError, *DAMAGE) as error:
                self.unreadable += 1
                if self.unreadable == 1:
                    log.warning("%s: a message of %r cannot be read (%s)", self.name, topic, error)
        if not count:
            self._state = EdgeState(connected=True, address=self._state.address, phase="ended")
        document.edge = self._state
        return count

    def ask(self, order: Order, then: Callable[[], None] | None = None) -> None:
        """Does nothing, since a recorded take does not change."""

    def close(self) -> None:
        """Does nothing: no file stays open between polls."""

    def _iterate_messages(self) -> Iterator[tuple[int, str, bytes]]:
        for _, message in zip(range(_MESSAGES_PER_POLL), self._messages, strict=False):
            yield message

    def _apply(self, document: Document, topic: str, data: bytes) -> None:
        """Applies one message to the document."""
        if topic == CHARACTER.name:
            self._add_character(document, data)
        elif topic == POSE.name:
            pose = msgspec.msgpack.decode(data, type=PoseMessage)
            key = (pose.character, pose.revision)
            if key not in self._held:
                self._look_ahead(document, *key)
            character, codec = self._held[key]
            document.add_pose(message_to_pose(pose, codec), character)
        else:
            track = find_track(STREAMS[topic])
            message = msgspec.msgpack.decode(data, type=STREAMS[topic].type)
            track.put(document, track.read(message, self.name))

    def _add_character(self, document: Document, data: bytes) -> None:
        """Adds the character of a message to the document unless it is already there."""
        message = msgspec.msgpack.decode(data, type=CharacterMessage)
        if self._revisions.get(message.id) != message.revision:
            character = message_to_character(message)
            self._held[message.id, message.revision] = character, PoseCodec(character)
            self._revisions[message.id] = message.revision
            document.add_character(character)

    def _look_ahead(self, document: Document, character_id: str, revision: int) -> None:
        """Searches for a later copy of a character if its first copy is damaged."""
        if (character_id, revision) in self._searched:
            return
        self._searched.add((character_id, revision))
        for _, data in self._recording.messages("character"):
            try:
                message = msgspec.msgpack.decode(data, type=CharacterMessage)
                if (message.id, message.revision) == (character_id, revision):
                    self._add_character(document, data)
                    return
            except (msgspec.MsgspecError, EnlivenError, ValueError):
                continue


def _merge_by_time(recording: Recording, topics: list[str]) -> Iterator[tuple[int, str, bytes]]:
    """Yields (time, topic, bytes) of several topics in order of time."""

    def of(order: int, topic: str) -> Iterator[tuple[int, int, str, bytes]]:
        for time_ns, data in recording.messages(topic):
            yield time_ns, order, topic, data

    streams = [of(order, topic) for order, topic in enumerate(topics)]
    for time_ns, _, topic, data in heapq.merge(*streams, key=lambda m: m[:2]):
        yield time_ns, topic, data
