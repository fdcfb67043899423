"""What may be wrong with a sensor or a performance, as typed states: kind, time of onset, remedy."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, StrEnum


class Severity(IntEnum):
    """How much a state of health hurts."""

    NOTE = 0
    """Nothing is wrong yet; it passes by itself, or is good to know."""
    WARNING = 1
    """The tracking suffers."""
    ERROR = 2
    """There is no tracking."""


class HealthKind(StrEnum):
    """What may be wrong."""

    NO_FRAMES = "no frames"
    SENSOR_LOST = "sensor lost"
    BAD_FRAME = "frame unusable"
    RESIZED = "image size changed"
    FROZEN = "sensor frozen"
    SLOW = "low frame rate"
    DROPPED = "frames dropped"
    OUT_OF_ORDER = "frames out of order"
    MOVED = "sensor moved"
    SLOW_LINK = "slow link"
    HOT = "sensor hot"
    NOT_CALIBRATED = "lens unknown"
    UPSIDE_DOWN = "sensor upside down"
    NOT_LEVEL = "floor not level"
    COVERED = "lens covered"
    MISSING_DEPTH = "missing depth"
    LEARNING_ROOM = "learning the room"
    NO_FLOOR = "floor unknown"
    TOO_NEAR = "performer too near"
    TOO_FAR = "performer too far"
    CUT_OFF = "performer cut off"
    JOINED = "performers joined"
    UNCLEAR = "performer unclear"
    TAKE_ENDED = "take ended"
    TAKE_GAPS = "take incomplete"
    TAKE_RESUMED = "take resumed"


NO_PERFORMER = -1
"""In place of a performer's id: the state is about the sensor or the whole scene."""


@dataclass(frozen=True)
class HealthState:
    """One thing that is wrong.

    Attributes:
        kind: a :class:`HealthKind`, or a later program's word for something that this one does not know.
        severity: how much it hurts.
        since_ns: when it began, the sensor's clock.
        what: what is wrong, one sentence.
        mend: what to do about it, one sentence.
        performer: the id of the performer that it is about, or :data:`NO_PERFORMER`.
    """

    kind: str
    severity: Severity
    since_ns: int
    what: str
    mend: str
    performer: int = NO_PERFORMER

    def __str__(self) -> str:
        return f"{self.what} {self.mend}"


def worst_first(states: list[HealthState]) -> list[HealthState]:
    """The gravest first; of equal gravity, what has lasted longest."""
    return sorted(states, key=lambda state: (-state.severity, state.since_ns, state.kind, state.performer))
