"""Settings of how a puppet is placed and how it follows its performers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from enliven.settings import parameter, setting


@dataclass(frozen=True)
class PuppetSettings:
    """Settings of a puppet that is driven live."""

    REMOVED_SETTINGS: ClassVar = (
        "ease",
        "pause",
    )
    lag: int = setting(
        3,
        "Delay from a performer's pose to the puppet's pose. Raise it for smoother motion, lower it for "
        "faster response.",
        unit="samples",
        low=0,
        high=30,
    )
    rate: float = parameter(
        60.0,
        "Samples per second of the puppet's motion, independent of the sensor's frame rate.",
        unit="1/s",
        low=5.0,
        high=240.0,
    )
    place: Literal["walks", "fixed"] = setting(
        "walks",
        '"walks": the puppet travels with its performer, on feet if it has any. "fixed": it stays in place.',
    )
    meet: bool = setting(
        True, "Starts the puppet next to its first performer. If false, it starts where it was modelled."
    )
    beside: float = setting(
        0.7,
        "Distance from the first performer's centre to the near edge of the puppet, to the right as "
        "the sensor sees it.",
        unit="m",
    )
    mirror: bool = setting(False, "Moves the puppet like the performer's mirror image.")
    fade: float = setting(
        0.6,
        "Duration of the blend after any change of the performers that drive the puppet.",
        unit="s",
        low=0.0,
        high=10.0,
    )
    fade_pace: float = parameter(
        2.5,
        "Maximum speed of the blend. Large changes take longer than `fade`.",
        unit="m/s",
        low=0.01,
        high=1000.0,
    )
    hand_over: float = setting(
        60.0,
        "If a performer is away for longer, and exactly one performer without a character is in view, "
        "that performer takes over. 0 turns this off.",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    jump: float = setting(
        1.0,
        "Height of the puppet's jump relative to the performer's, each in proportion to body size. 0 "
        "turns jumps off.",
        low=0.0,
        high=10.0,
    )
