"""The type of a choreography, and the place where its performer starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from enliven_synthesis.body import PerformerPosture

HOME_Z = -2.7
"""Metres: z of the performer's start, before a camera above the world's origin that looks along -Z."""


@dataclass(frozen=True)
class Choreography:
    """A named movement.

    Attributes:
        duration: seconds; the posture at the end equals that at the start.
        posture: gives the posture at a time in [0, duration].
        planted: tells whether the left (0) or right (1) foot stands on the floor at a time.
    """

    name: str
    duration: float
    posture: Callable[[float], PerformerPosture]
    planted: Callable[[int, float], bool]
