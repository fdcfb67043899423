"""The state of an edge that new viewers need.

It consists of the heartbeat, the characters, and the newest message of each key.
"""

from __future__ import annotations

from typing import Any

import msgspec

from enliven.wire import (
    MAX_LATCHED_MESSAGES,
    SCAN,
    SCAN_PIECE,
    CharacterMessage,
    Revision,
    StatusMessage,
    Topic,
    Welcome,
    pack_payload,
    unpack_stream,
)

_MAX_LATCHED_BYTES = 128 * 1024 * 1024
"""Maximum bytes of the newest messages. The chunks of a scanned room take about 40 MB."""
MAX_CHARACTER_BYTES = 512 * 1024 * 1024
"""Maximum bytes of all characters. It is the limit of a viewer."""


class RelayedState:
    """The data that a viewer gets when it connects: the same as from the edge itself.

    Attributes:
        status: the edge's last heartbeat, or None before the first one.
        wanted: the revision of each character on the edge, by id.
        packed: the packed answer with each received character, by id.
    """

    def __init__(self) -> None:
        self.status: StatusMessage | None = None
        self.wanted: dict[str, int] = {}
        self.packed: dict[str, bytes] = {}
        self._revisions: dict[str, int] = {}
        self._complete_revision = -1
        self._latest: dict[tuple[str, str], bytes] = {}
        self._latched_bytes = 0
        self._scan_number = 0

    @property
    def missing(self) -> list[str]:
        """Returns the ids of characters that were not received yet in their newest revision."""
        return [name for name, revision in self.wanted.items() if self._revisions.get(name) != revision]

    def restart(self) -> None:
        """Drops the state of an edge process that has ended."""
        self.__init__()  # type: ignore[misc]

    def list_characters(self, answer: Welcome) -> None:
        """Replaces the list of characters and the newest messages by those in the edge's answer."""
        self.wanted = {entry.character: entry.revision for entry in answer.characters}
        for removed_id in self.packed.keys() - self.wanted.keys():
            del self.packed[removed_id], self._revisions[removed_id]
        self._complete_revision = answer.status.revision
        self._latest.clear()
        self._latched_bytes = 0
        for data in answer.latest:
            self.store_latched(*unpack_stream(data), data)

    def add_character(self, message: CharacterMessage) -> bool:
        """Stores a character. Returns False if it does not fit into memory, or is not on the edge."""
        payload = pack_payload(message)
        other_bytes = sum(len(data) for name, data in self.packed.items() if name != message.id)
        if message.id not in self.wanted or other_bytes + len(payload) > MAX_CHARACTER_BYTES:
            return False
        self.packed[message.id], self._revisions[message.id] = payload, message.revision
        return True

    def store_latched(self, topic: Topic, message: Any, data: bytes) -> None:
        """Stores a message of a latched topic as the newest one of its key."""
        if topic is SCAN:
            self._watch_scan(message.number, message.phase)
        if not topic.latched or (topic.is_per_character and message.character not in self.wanted):
            return
        key = (topic.name, topic.key(message))
        self._drop_latched(key)
        self._latest[key] = data
        self._latched_bytes += len(data)
        while len(self._latest) > MAX_LATCHED_MESSAGES or self._latched_bytes > _MAX_LATCHED_BYTES:
            self._drop_latched(next(iter(self._latest)))

    def welcome(self, role: str) -> Welcome | None:
        """Returns the answer to a viewer's hello, or None before the first heartbeat.

        The heartbeat in the answer has the revision of the listed characters. So a viewer asks again when it
        receives a heartbeat with a newer revision.
        """
        if self.status is None:
            return None
        revisions = [Revision(name, revision) for name, revision in self._revisions.items()]
        incomplete = self._complete_revision != self.status.revision or bool(self.missing)
        shown_revision = max(self.status.revision - 1, 0) if incomplete else self.status.revision
        status = msgspec.structs.replace(self.status, revision=shown_revision)
        return Welcome(status, revisions, list(self._latest.values()), role)

    @property
    def is_listed(self) -> bool:
        """Returns True if the list of characters agrees with that of the edge."""
        return self.status is not None and self.status.revision == self._complete_revision

    def _watch_scan(self, number: int, phase: str) -> None:
        """Drops the chunks of a scan that has ended, as the edge does."""
        if number != self._scan_number or phase in ("off", "done"):
            for key in [key for key in self._latest if key[0] == SCAN_PIECE.name]:
                self._drop_latched(key)
        self._scan_number = number

    def _drop_latched(self, key: tuple[str, str]) -> None:
        data = self._latest.pop(key, None)
        self._latched_bytes -= 0 if data is None else len(data)
