"""The values received from one edge that no caller has fetched yet, and the newest of each key."""

from __future__ import annotations

from collections.abc import Set
from typing import Any

from enliven.wire import STREAMS, Topic
from enliven_viewer.link.bounded_containers import BoundedQueue, NewestValues

MAX_STORED_FRAMES = 4000
"""Maximum number of unfetched poses, and of unfetched frames of bodies: two minutes of one character."""
_MAX_STORED_BYTES = 64 * 1024 * 1024
"""Maximum size of a topic's unfetched values in bytes: two minutes of poses of a graph with 1,000 nodes."""
_MAX_KEYS = 4096
"""Maximum number of keys of a topic, such as the blocks of a scan. The newest value of each key is stored. An
edge sends no more keys than this.
"""
_MAX_NEWEST_BYTES = 128 * 1024 * 1024
"""Maximum size of a topic's newest values in bytes. The blocks of a scanned room take about 40 MB."""


class ReceivedValues:
    """Values by topic, within limits of memory.

    Attributes:
        inbox: the unfetched values by topic. The topic's ``keep`` determines whether these are all values or
            only the newest of each key.
        latest: the newest value by topic and key.
    """

    def __init__(self) -> None:
        self.inbox: dict[str, BoundedQueue[Any] | NewestValues] = {}
        self.latest: dict[str, NewestValues] = {}

    def store(self, topic: Topic, key: str, value: Any, size: int) -> None:
        """Stores a value of ``size`` bytes in the inbox for the caller, and as the newest of its key."""
        if topic.name not in self.inbox:
            # Keep only the newest camera image. A caller that never fetches them, such as a kiosk, would
            # otherwise store thousands.
            self.inbox[topic.name] = (
                BoundedQueue(MAX_STORED_FRAMES, _MAX_STORED_BYTES)
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

    def forget_unlisted(self, listed_ids: Set[str]) -> None:
        """Removes the newest values about characters that the edge does not list."""
        for name, newest in self.latest.items():
            if STREAMS[name].is_per_character:
                for unlisted_id in newest.keys() - listed_ids:
                    newest.forget(unlisted_id)
