"""The type of a choreography, and the start position of its performer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from enliven_synthesis.body.posture import PerformerPosture

START_Z_M = -2.7
"""Z of the performer's start position in metres. The camera is above the world's origin and looks along
-Z."""


@dataclass(frozen=True)
class Choreography:
    """A named movement.

    Attributes:
        duration: length in seconds. The last posture equals the first.
        posture: returns the posture at a time in [0, duration].
        planted: returns True if the left (0) or right (1) foot stands on the floor at a time.
    """

    name: str
    duration: float
    posture: Callable[[float], PerformerPosture]
    planted: Callable[[int, float], bool]
