"""The characters of one edge: which ones it lists, the received ones, and the poses that wait for them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from msgspec.structs import astuple

from enliven.document import Character
from enliven.wire import (
    CharacterMessage,
    MalformedMessageError,
    PoseCodec,
    PoseMessage,
    Revision,
    Topic,
    message_to_character,
)
from enliven_viewer.link.bounded_containers import BoundedQueue
from enliven_viewer.link.received_values import MAX_STORED_FRAMES

MAX_UNREAD_BYTES = 16 * 1024 * 1024
"""Maximum size in bytes of messages that are queued until their character has arrived, or until the sending
process is known.
"""
MAX_UNKNOWN_CHARACTERS = 64
"""Maximum number of characters in messages that the edge has not listed yet: four times the capacity of a
stage.
"""
_MAX_CHARACTER_BYTES = 512 * 1024 * 1024
"""Maximum size of all characters of an edge in bytes: enough for four characters of two million vertices
each.
"""
_FULL_RETRY_INTERVAL_S = 30.0
"""Seconds until a character that exceeds the memory limit is requested again."""


@dataclass(frozen=True)
class HeldCharacter:
    """A received character.

    Attributes:
        revision: its revision on the edge.
        character: the character, with its id in this viewer.
        codec: decodes its poses.
        size: size of its message in bytes.
    """

    revision: int
    character: Character
    codec: PoseCodec
    size: int


class EdgeCharacters:
    """The characters that an edge lists, and those that have been received.

    Ids are those on the edge, except in :attr:`held`.

    Args:
        label: returns a character's id in this viewer, given its id on the edge.

    Attributes:
        held: the received characters by their id in this viewer. They stay while a restarted edge has not
            sent its list.
        wanted: the listed characters and their revisions.
        revisions: the revisions of the received characters.
        unknown: characters in messages that the edge has not listed yet.
        waiting: poses, with their time of arrival in nanoseconds, that wait for their character.
    """

    def __init__(self, label: Callable[[str], str]) -> None:
        self._label = label
        self.held: dict[str, HeldCharacter] = {}
        self.begin_instance()

    def begin_instance(self) -> None:
        """Forgets the list, because another process of the edge sends its own."""
        self.wanted: dict[str, int] = {}
        self.revisions: dict[str, int] = {}
        self.unknown: set[str] = set()
        self.waiting: BoundedQueue[tuple[PoseMessage, int]] = BoundedQueue(
            MAX_STORED_FRAMES, MAX_UNREAD_BYTES
        )
        self._asked_at: dict[str, float] = {}

    @property
    def is_complete(self) -> bool:
        """Returns True if all listed characters have been received."""
        return self.revisions == self.wanted

    def accepts(self, topic: Topic, message: Any) -> bool:
        """Returns True if a message is about a listed character, or about one of a few unlisted ones.

        Raises:
            MalformedMessageError: if there are too many unlisted characters.
        """
        if (
            not topic.is_per_character
            or message.character in self.wanted
            or message.character in self.unknown
        ):
            return True
        if len(self.unknown) >= MAX_UNKNOWN_CHARACTERS:
            raise MalformedMessageError(
                topic.name, "the message is about a character that the edge does not list"
            )
        self.unknown.add(message.character)
        return True

    def find(self, message: PoseMessage, received_ns: int) -> HeldCharacter | None:
        """Returns the character of a pose.

        Returns None if its revision has not been received. Then the pose waits for it; an older pose is
        dropped.
        """
        held_revision = self.revisions.get(message.character, 0)
        if held_revision == message.revision:
            return self.held[self._label(message.character)]
        if message.revision > held_revision:
            self.waiting.append((message, received_ns), len(message.transforms))
        return None

    def set_list(self, entries: Sequence[Revision]) -> set[str]:
        """Stores the edge's list, and removes unlisted characters.

        Returns the listed ids in this viewer.
        """
        listed = {entry.character: entry.revision for entry in entries}
        self._asked_at = {c: t for c, t in self._asked_at.items() if listed.get(c) == self.wanted.get(c)}
        self.wanted = listed
        self.revisions = {name: revision for name, revision in self.revisions.items() if name in listed}
        self.unknown.clear()
        listed_ids = {self._label(character) for character in listed}
        self.held = {name: held for name, held in self.held.items() if name in listed_ids}
        return listed_ids

    def list_missing(self, now: float, interval: float) -> Iterator[str]:
        """Yields the missing characters that were not requested in the last ``interval`` seconds."""
        for character, revision in self.wanted.items():
            if (
                self.revisions.get(character) != revision
                and now - self._asked_at.get(character, 0.0) > interval
            ):
                yield character

    def record_request(self, character: str, now: float) -> None:
        """Records the time of a request for a character."""
        self._asked_at[character] = now

    def add(self, message: CharacterMessage, now: float) -> bool:
        """Stores a character. Returns False if it exceeds the memory limit. It is then requested again later.

        Raises:
            EnlivenError: if it is unusable. The old revision stays.
            ValueError: likewise.
        """
        character_id = self._label(message.id)
        character = replace(message_to_character(message), id=character_id)
        codec = PoseCodec(character)
        size = count_bytes(message)
        other_bytes = sum(held.size for name, held in self.held.items() if name != character_id)
        if other_bytes + size > _MAX_CHARACTER_BYTES:
            self._asked_at[message.id] = now + _FULL_RETRY_INTERVAL_S
            return False
        self.held[character_id] = HeldCharacter(message.revision, character, codec, size)
        self.revisions[message.id] = message.revision
        return True

    def describe_limit(self, edge: str) -> str:
        """Returns a warning that the characters of an edge do not fit into memory."""
        max_megabytes = _MAX_CHARACTER_BYTES // 1024**2
        problem = f"the characters of {edge} have more than {max_megabytes} MB"
        return f"{problem}, so some are not shown. Remove some characters from the stage"


def count_bytes(message: CharacterMessage) -> int:
    """Returns the number of bytes of a character's arrays and images."""
    parts = [*astuple(message)]
    if message.materials is not None:
        parts += [*astuple(message.materials), *(texture.image for texture in message.materials.textures)]
    return sum(len(part) for part in parts if isinstance(part, bytes))
