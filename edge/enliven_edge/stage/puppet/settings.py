"""Settings of how a puppet is placed and how it follows its performers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from enliven.settings import setting


@dataclass(frozen=True)
class PuppetSettings:
    """Settings of a puppet that is driven live."""

    lag: int = setting(
        3, "Samples from a pose to the answer: more is smoother, and later.", unit="samples", low=0, high=30
    )
    rate: float = setting(
        60.0, "Samples a second, whatever the sensor's own frames are.", unit="1/s", low=5.0, high=240.0
    )
    place: Literal["walks", "fixed"] = setting(
        "walks",
        '"walks": it goes where its performer goes, on feet if it has some; "fixed": it stays on its spot.',
    )
    meet: bool = setting(True, "It begins beside its first performer; false: where it was modelled.")
    beside: float = setting(
        0.7,
        "Distance of its edge from the first performer's middle, to the right as the sensor sees it.",
        unit="m",
    )
    mirror: bool = setting(False, "It moves like the performer's mirror image.")
    fade: float = setting(0.6, "Time to ease over any change of who moves it.", unit="s", low=0.0, high=10.0)
    fade_pace: float = setting(
        2.5,
        "Fastest that easing moves anything: a wide change takes longer.",
        unit="m/s",
        low=0.01,
        high=1000.0,
    )
    ease: float = setting(
        0.4, "Time until a joint that is seen again counts fully.", unit="s", low=0.0, high=10.0
    )
    pause: float = setting(
        0.3, "Gap between frames after which it starts anew, and eases over.", unit="s", low=0.05, high=60.0
    )
    hand_over: float = setting(
        60.0,
        "A performer away for longer loses the hold to the only idle one in view; 0: never.",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    jump: float = setting(
        1.0, "How high it jumps, for a performer's jump at its own size; 0: not at all.", low=0.0, high=10.0
    )
