"""The settings of calibration and fusion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from enliven.settings import parameter, setting

MAX_TRACK_GAP_S = 0.12
"""Maximum gap in seconds in a track that is interpolated."""
MAX_BODY_AGE_S = 0.15
"""Maximum age of bodies in seconds. Older bodies are not fused."""


@dataclass(frozen=True)
class CalibrationSettings:
    """Settings of the calibration: how people are matched, and when the result is good enough."""

    REMOVED_SETTINGS: ClassVar = (
        "tilt",
        "floor_height",
        "longest_gap",
        "width",
        "worst_residual",
        "doubt_cm",
        "doubt_deg",
        "clock_range",
    )
    floor_known: bool = setting(
        True, "Uses the floor that each sensor detected: the y axis points up, and the floor is at y = 0."
    )
    overlap: float = parameter(
        4.0, "Minimum time for which two sensors must see the same person.", unit="s", low=0.5
    )
    narrowest: float = setting(
        0.5,
        "Minimum width of the area in which the person walks. A straight line does not fix the "
        "sensors' poses.",
        unit="m",
        low=0.0,
        high=10.0,
    )


@dataclass(frozen=True)
class FusionSettings:
    """Settings of the fusion of several sensors' bodies."""

    REMOVED_SETTINGS: ClassVar = (
        "gate",
        "patience",
        "believe_ids",
        "turn_over",
        "near_noise",
        "far_noise",
        "hand_over",
        "silence",
    )
    loyalty: float = setting(
        0.15,
        "A body gets another identity only if it is nearer to that person by this distance. Raise it if "
        "identities swap.",
        unit="m",
        low=0.0,
        high=2.0,
    )
    remember: float = setting(
        3.0,
        "Time for which the identity of an unseen person is kept at the last position.",
        unit="s",
        low=0.0,
        high=600.0,
    )
    sure_after: int = parameter(
        5,
        "Number of observations, summed over all sensors, before a new person is reported.",
        low=1,
        high=100,
    )
    sure_beside: int = setting(
        12,
        "Number of observations, over all sensors, before an additional person is reported. Raise it if "
        "one person appears twice.",
        low=1,
        high=100,
    )
