"""Measures the health of each topic at the receiver: whether it is alive, at its expected rate and valid."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass
from typing import Literal

from enliven.wire import Topic

SILENCE_TIMEOUT_S = 2.0
"""Seconds without a message after which a topic or an edge counts as silent: four heartbeats."""
RATE_WINDOW_S = 2.0
"""Length in seconds of the window in which messages are counted: long enough for a steady value, short enough
to react quickly.
"""
_MAX_ARRIVALS = 8000
"""Maximum number of stored arrival times: the messages of 130 characters in two seconds."""
_MIN_RATE_FRACTION = 0.5
"""Minimum fraction of the expected rate at which a topic counts as on rate. Occasional lost messages are not
a fault.
"""


@dataclass(frozen=True)
class TopicHealth:
    """The health of one topic of an edge.

    Attributes:
        alive: whether a message arrived recently.
        on_rate: whether messages arrive as often as the topic table and the edge's own rate require.
        valid: whether all recent messages could be read.
        hz: recent messages per second and key.
        malformed: number of messages that could not be read.
    """

    alive: bool = False
    on_rate: bool = False
    valid: bool = True
    hz: float = 0.0
    malformed: int = 0

    @property
    def signal(self) -> Literal["live", "slow", "damaged", "silent"]:
        """Returns the health as one word."""
        if not self.alive:
            return "silent"
        return "damaged" if not self.valid else "live" if self.on_rate else "slow"


class TopicWatch:
    """A counter of the messages of one topic of one edge."""

    def __init__(self, topic: Topic) -> None:
        self._topic = topic
        self._arrivals: deque[tuple[float, str]] = deque(maxlen=_MAX_ARRIVALS)
        self._heard = self._failed = float("-inf")
        self._malformed = 0

    def count_message(self, key: str) -> None:
        """Counts a message, with its key."""
        self._heard = time.monotonic()
        self._arrivals.append((self._heard, key))

    def count_failure(self) -> None:
        """Counts a message that could not be read."""
        self._failed = time.monotonic()
        self._malformed += 1

    def health(self, fps: float = 0.0) -> TopicHealth:
        """Returns the current health.

        Args:
            fps: the edge's announced frames per second; 0 if not announced.
        """
        now = time.monotonic()
        while self._arrivals and now - self._arrivals[0][0] > RATE_WINDOW_S:
            self._arrivals.popleft()
        keys = {key for _, key in self._arrivals}
        hz = len(self._arrivals) / RATE_WINDOW_S / max(len(keys), 1)
        alive = now - self._heard <= SILENCE_TIMEOUT_S
        expected_rate = min(fps or self._topic.rate_hz, self._topic.rate_hz)
        on_rate = alive and hz >= _MIN_RATE_FRACTION * expected_rate
        return TopicHealth(alive, on_rate, now - self._failed > RATE_WINDOW_S, hz, self._malformed)
