"""How a puppet meets and follows its performers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from enliven.settings import setting


@dataclass(frozen=True)
class PuppetSettings:
    """A few example poses, live."""

    lag: int = setting(
        3, "Samples from a pose to the answer: more is smoother, and later.", unit="samples", low=0, high=30
    )
    rate: float = setting(
        60.0, "Samples a second, whatever the sensor's own frames are.", unit="1/s", low=5.0, high=240.0
    )
    place: Literal["walks", "fixed"] = setting(
        "walks",
        '"walks": it goes through the world on its feet, where it has some; "fixed": it stays on its spot.',
    )
    meet: bool = setting(True, "It begins beside its first performer; false: where it was modelled.")
    beside: float = setting(
        0.7,
        "How far beside the first performer's middle its own edge is, to the right as the sensor sees it.",
        unit="m",
    )
    mirror: bool = setting(False, "It is like the performer's picture in a mirror.")
    fade: float = setting(0.6, "Seconds that a change takes to show.", unit="s", low=0.0, high=10.0)
    fade_pace: float = setting(
        2.5, "How fast it goes at most while a change shows.", unit="m/s", low=0.01, high=1000.0
    )
    ease: float = setting(
        0.4, "Seconds in which a joint that is seen again counts fully.", unit="s", low=0.0, high=10.0
    )
    pause: float = setting(
        0.3, "After so long without a frame it begins anew, and eases over.", unit="s", low=0.05, high=60.0
    )
    hand_over: float = setting(
        60.0,
        "Who alone moves nothing goes on for who has been away for longer; 0: only who takes hold.",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    jump: float = setting(
        1.0, "How high it jumps, for a performer's jump at its own size; 0: not at all.", low=0.0, high=10.0
    )
