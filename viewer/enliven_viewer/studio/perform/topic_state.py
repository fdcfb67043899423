"""The last state that an edge published on a topic, and whether an edge is too old to publish it."""

from __future__ import annotations

import time
from typing import Generic, TypeVar

from enliven.wire import Topic
from enliven_viewer.language import later
from enliven_viewer.link.edge_client import EdgeClient

NOT_READY_TEXT = later("Waiting for the stage")
"""Shown instead of a state that an edge has not sent yet."""
MAX_FIRST_STATE_DELAY_S = 3.0
"""Seconds from an edge's first message after which a missing state means an older edge.

An edge sends its states at once; the subscription and a loaded machine delay them by up to a second.
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
        """Discards the state after the link was closed."""
        self.message = self._instance = None

    @property
    def is_unsupported(self) -> bool:
        """Returns True if an edge is connected that does not publish this state, so it is older."""
        waited = (
            self._instance is not None and time.monotonic() - self._connected_since > MAX_FIRST_STATE_DELAY_S
        )
        return self.message is None and waited
