"""Stores the last state that an edge published on a topic, and detects an edge that is too old
to publish it.
"""

from __future__ import annotations

import time
from typing import Generic, TypeVar

from enliven.wire import Topic
from enliven_viewer.language import later
from enliven_viewer.link.edge_client import EdgeClient

NOT_READY_TEXT = later("Waiting for the stage")
"""Text that is shown while the edge has not sent the state yet."""
MAX_FIRST_STATE_DELAY_S = 3.0
"""If the state is still missing this number of seconds after an edge's first message, the edge is too old. A
new edge sends its states immediately. The subscription and a busy machine delay them by up to a second.
"""
Message = TypeVar("Message")


class TopicState(Generic[Message]):
    """The last message of a topic that has one message for the whole edge.

    Attributes:
        message: the last message; None before the edge has sent one.
    """

    def __init__(self, topic: Topic) -> None:
        self._topic = topic
        self.message: Message | None = None
        self._instance: int | None = None
        self._connected_since = 0.0

    def advance(self, client: EdgeClient) -> None:
        """Reads the messages that arrived."""
        client.take(self._topic)
        self.message = client.latest(self._topic).get("")
        instance = client.edges[0].instance
        if instance != self._instance:
            self._instance, self._connected_since = instance, time.monotonic()

    def forget(self) -> None:
        """Discards the state after the connection was closed."""
        self.message = self._instance = None

    @property
    def is_unsupported(self) -> bool:
        """Returns True if a connected edge does not publish this state, because it is an older version."""
        waited = (
            self._instance is not None and time.monotonic() - self._connected_since > MAX_FIRST_STATE_DELAY_S
        )
        return self.message is None and waited
