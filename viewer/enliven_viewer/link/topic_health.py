"""The health of each topic as the link hears it: alive, on rate, valid."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass
from typing import Literal

from enliven.wire import Topic

SILENT_AFTER = 2.0
"""Seconds without a message after which a topic, or an edge, counts as silent: four heartbeats."""
RATE_OVER = 2.0
"""Seconds over which messages are counted: steady to read, and soon right."""
_MOST = 8000
"""Arrivals that are remembered: two seconds of 130 characters."""
_ENOUGH = 0.5
"""Share of the expected rate from which a topic is on rate: a lost message now and then is no fault."""


@dataclass(frozen=True)
class TopicHealth:
    """What a viewer knows of one topic of an edge.

    Attributes:
        alive: whether a message came within the last seconds.
        on_rate: whether messages come as often as they should, by the table and the edge's own rate.
        valid: whether all of the last seconds could be read.
        hz: messages a second of late, of each key.
        malformed: messages so far that could not be read.
    """

    alive: bool = False
    on_rate: bool = False
    valid: bool = True
    hz: float = 0.0
    malformed: int = 0

    @property
    def signal(self) -> Literal["live", "slow", "damaged", "silent"]:
        """Returns the health in a word."""
        if not self.alive:
            return "silent"
        return "damaged" if not self.valid else "live" if self.on_rate else "slow"


class TopicWatch:
    """Counts the messages of one topic of one edge."""

    def __init__(self, topic: Topic) -> None:
        self._topic = topic
        self._arrivals: deque[tuple[float, str]] = deque(maxlen=_MOST)
        self._heard = self._failed = float("-inf")
        self._malformed = 0

    def took(self, key: str) -> None:
        """Counts a message with the key of its topic."""
        self._heard = time.monotonic()
        self._arrivals.append((self._heard, key))

    def failed(self) -> None:
        """Counts a message that could not be read."""
        self._failed = time.monotonic()
        self._malformed += 1

    def health(self, fps: float = 0.0) -> TopicHealth:
        """Returns the health now.

        Args:
            fps: frames per second that the edge says it has; 0: it does not say.
        """
        now = time.monotonic()
        while self._arrivals and now - self._arrivals[0][0] > RATE_OVER:
            self._arrivals.popleft()
        keys = {key for _, key in self._arrivals}
        hz = len(self._arrivals) / RATE_OVER / max(len(keys), 1)
        alive = now - self._heard <= SILENT_AFTER
        wanted = min(fps or self._topic.rate_hz, self._topic.rate_hz)
        on_rate = alive and hz >= _ENOUGH * wanted
        return TopicHealth(alive, on_rate, now - self._failed > RATE_OVER, hz, self._malformed)
