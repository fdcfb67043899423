"""Health states: typed problems of a sensor or a performance, with kind, start time and remedy."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, StrEnum


class Severity(IntEnum):
    """The severity of a health state."""

    NOTE = 0
    """Not a problem. The state ends by itself, or is only information."""
    WARNING = 1
    """Tracking is impaired."""
    ERROR = 2
    """Tracking fails."""


class HealthKind(StrEnum):
    """The kinds of problems of a sensor or a performance."""

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
    OUTPUT_FAILS = "output fails"


NO_PERFORMER = -1
"""Value instead of a performer's id for a state that concerns the sensor or the whole scene."""


@dataclass(frozen=True)
class HealthState:
    """One problem.

    Attributes:
        kind: a :class:`HealthKind`, or an unknown kind from a later version of the program.
        severity: its severity.
        since_ns: start of the problem, nanoseconds of the sensor's clock.
        what: one sentence about the problem.
        remedy: one sentence about the remedy.
        performer: the id of the affected performer, or :data:`NO_PERFORMER`.
    """

    kind: str
    severity: Severity
    since_ns: int
    what: str
    remedy: str
    performer: int = NO_PERFORMER

    def __str__(self) -> str:
        return f"{self.what} {self.remedy}"


def sort_by_severity(states: list[HealthState]) -> list[HealthState]:
    """Returns the states sorted by severity, the most severe first.

    Among states of equal severity, the oldest comes first.
    """
    return sorted(states, key=lambda state: (-state.severity, state.since_ns, state.kind, state.performer))
