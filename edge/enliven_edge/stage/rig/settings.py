"""Settings of how a part of a rigged character is chosen and driven."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.matching import PickingSettings, RankingSettings
from enliven.settings import setting


@dataclass(frozen=True)
class MatchingSettings:
    """Settings of choosing by posing and animating by moving."""

    height: float = setting(
        1.2, "Height of the model; 0 takes it as modelled.", unit="m", low=0.0, high=100.0
    )
    beside: float = setting(
        0.7,
        "Distance of its edge from the first performer's middle, to the right as the sensor sees it.",
        unit="m",
    )
    mirror: bool = setting(True, "The character moves like the performer's mirror image.")
    extend: bool = setting(
        True, "Chains extend along the longest branch that hangs on them; else it is carried rigidly."
    )
    fade: float = setting(0.6, "Time to ease over any change of who drives.", unit="s", low=0.0, high=10.0)
    hand_over: float = setting(
        60.0,
        "A performer away for longer loses the hold to the only idle one in view; 0: never.",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    listed: int = setting(6, "Matches sent to viewers.", unit="matches", low=1, high=15)
    ranking: RankingSettings = setting(RankingSettings, "How matches are scored.")
    picking: PickingSettings = setting(
        PickingSettings, "When the shown match changes, and when it is accepted."
    )
