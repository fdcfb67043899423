"""What a choreography is, and where its performer stands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from enliven_synthesis.body import Posture

HOME_Z = -2.7
"""Metres: where the performer starts, before a camera above the world's origin that looks along -Z."""


@dataclass(frozen=True)
class Choreography:
    """A named movement.

    Attributes:
        duration: seconds; the posture at its end is that of its beginning.
        posture: the posture at a time in [0, duration].
        planted: whether the left (0) or right (1) foot stands on the floor at a time.
    """

    name: str
    duration: float
    posture: Callable[[float], Posture]
    planted: Callable[[int, float], bool]
