"""States and warnings of the single sensors of a fused set."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class SensorState(StrEnum):
    """The state of one sensor of several; every state but LIVE gives a warning."""

    WAITING = "waiting"
    """It has not said anything yet."""
    LIVE = "live"
    SILENT = "silent"
    """Its frames have stopped coming."""
    FROZEN = "frozen"
    """Its frames come, and are all the same."""
    MOVED = "moved"
    """What it sees no longer lies where the others see it: it was knocked, or is not calibrated."""
    LOST = "lost"
    """It was unplugged, or failed."""
    ENDED = "ended"
    """Its recording is over."""


@dataclass(frozen=True)
class SensorWarning:
    """A change of a sensor's state that the user should know.

    Attributes:
        sensor: its identity.
        state: what it is now.
        what: one sentence.
        time_ns: the common clock.
    """

    sensor: str
    state: SensorState
    what: str
    time_ns: int


SENTENCE = {
    SensorState.WAITING: "has not sent anything yet",
    SensorState.LIVE: "is back",
    SensorState.SILENT: "sends nothing any more; the others go on",
    SensorState.FROZEN: "sends the same picture again and again; the others go on",
    SensorState.MOVED: "sees people elsewhere than the others do: it was moved, calibrate again",
    SensorState.LOST: "was lost; the others go on",
    SensorState.ENDED: "has ended",
}
"""The sentence about each state."""
