"""Plays a take from a file: a recording of the messages that went over the wire, by topic."""

from __future__ import annotations

import heapq
import logging
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec

from enliven.errors import EnlivenError, InputError
from enliven.files import DAMAGE
from enliven.recording import Recording
from enliven.wire import (
    BodiesMessage,
    CharacterMessage,
    CuesMessage,
    Look,
    MatchesMessage,
    Mode,
    PoseCodec,
    PoseMessage,
    PropsMessage,
    message_to_board,
    message_to_bodies,
    message_to_character,
    message_to_cues,
    message_to_owners,
    message_to_pose,
    message_to_props,
)
from enliven_viewer.playback import CueFrame, Document, EdgeState

log = logging.getLogger(__name__)

TOPICS = ("character", "bodies", "pose", "props", "matches", "cues")
"""The topics of a take; messages of one time are applied in this order."""
_BATCH = 96
"""Messages that one poll applies: about a second of a take, so that the window draws while it is read."""


class TakeFeed:
    """A :class:`~enliven_viewer.link.feed.Feed` that reads a take a little further with every poll.

    A message that cannot be read is left out; the first such is logged. A take holds copies of each
    character: where the first is damaged, poses are read by any other of their revision.

    Raises:
        InputError: where the file is no recording, or holds no poses.
    """

    def __init__(self, path: Path) -> None:
        recording = Recording(path)
        present = [t for t in TOPICS if t in recording.info.topics]
        if not {"character", "pose"} <= set(present):
            raise InputError(
                "it holds no performance (characters and poses)",
                where=str(path),
                mend="Drive a mesh with it: enliven run --recording FILE.",
            )
        self.name = path.name
        self.unreadable = 0
        self._recording = recording
        self._messages = _merged(recording, present)
        self._revisions: dict[str, int] = {}
        self._codecs: dict[tuple[str, int], PoseCodec] = {}
        self._searched: set[tuple[str, int]] = set()
        self._state = EdgeState(connected=True, address=str(path), phase="playing")

    def poll(self, document: Document) -> int:
        """Apply the next messages in the order of time; 0 at the end of the take."""
        count = 0
        for _, topic, data in self._next():
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

    def possess(
        self, character_id: str, body: int | None = None, parts: str = "all", mode: Mode = "alone"
    ) -> None:
        """Do nothing, since a recorded take does not change."""

    def release(self, character_id: str, body: int | None = None) -> None:
        """Do nothing, since a recorded take does not change."""

    def smooth(self, body: int, amount: float | None = None) -> None:
        """Do nothing, since a recorded take does not change."""

    def lock(self, on: bool, then: Callable[[], None]) -> None:
        """Do nothing, since a recorded take does not change."""

    def look(self, look: Look) -> None:
        """Do nothing, since a recorded take does not change."""

    def browse(self, character_id: str, step: int = 1) -> None:
        """Do nothing, since a recorded take does not change."""

    def close(self) -> None:
        """Nothing stays open between polls."""

    def _next(self) -> Iterator[tuple[int, str, bytes]]:
        for _, message in zip(range(_BATCH), self._messages, strict=False):
            yield message

    def _apply(self, document: Document, topic: str, data: bytes) -> None:
        """One message into the document."""
        if topic == "character":
            self._introduce(document, data)
        elif topic == "bodies":
            seen = msgspec.msgpack.decode(data, type=BodiesMessage)
            document.add_bodies(seen.time_ns, message_to_bodies(seen))
        elif topic == "pose":
            pose = msgspec.msgpack.decode(data, type=PoseMessage)
            key = (pose.character, pose.revision)
            if key not in self._codecs:
                self._look_ahead(document, *key)
            if self._revisions[pose.character] == pose.revision:
                document.add_pose(message_to_pose(pose, self._codecs[key]))
        elif topic == "props":
            document.add_props(message_to_props(msgspec.msgpack.decode(data, type=PropsMessage)))
        elif topic == "matches":
            document.add_board(message_to_board(msgspec.msgpack.decode(data, type=MatchesMessage)))
        else:
            cues = msgspec.msgpack.decode(data, type=CuesMessage)
            shown = CueFrame(
                cues.character, *message_to_cues(cues), cues.state, message_to_owners(cues), cues.held
            )
            document.set_cues(shown, cues.time_ns)

    def _introduce(self, document: Document, data: bytes) -> None:
        """Put the character of a message into the document, unless it is there already."""
        made = msgspec.msgpack.decode(data, type=CharacterMessage)
        if self._revisions.get(made.id) != made.revision:
            character = message_to_character(made)
            self._codecs[made.id, made.revision] = PoseCodec(character)
            self._revisions[made.id] = made.revision
            document.add_character(character)

    def _look_ahead(self, document: Document, character_id: str, revision: int) -> None:
        """Search a later copy of a character, where its first copy is damaged."""
        if (character_id, revision) in self._searched:
            return
        self._searched.add((character_id, revision))
        for _, data in self._recording.messages("character"):
            try:
                made = msgspec.msgpack.decode(data, type=CharacterMessage)
                if (made.id, made.revision) == (character_id, revision):
                    self._introduce(document, data)
                    return
            except (msgspec.MsgspecError, EnlivenError, ValueError):
                continue


def _merged(recording: Recording, topics: list[str]) -> Iterator[tuple[int, str, bytes]]:
    """(time, topic, bytes) of several topics in the order of time."""

    def of(order: int, topic: str) -> Iterator[tuple[int, int, str, bytes]]:
        for time_ns, data in recording.messages(topic):
            yield time_ns, order, topic, data

    streams = [of(order, topic) for order, topic in enumerate(topics)]
    for time_ns, _, topic, data in heapq.merge(*streams, key=lambda m: m[:2]):
        yield time_ns, topic, data
