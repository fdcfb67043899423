"""How rigged characters are chosen from and driven."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.matching import PickingSettings, RankingSettings
from enliven.settings import setting


@dataclass(frozen=True)
class MatchingSettings:
    """Posing to choose, moving to animate."""

    height: float = setting(
        1.2, "Height of the model; 0 takes it as modelled.", unit="m", low=0.0, high=100.0
    )
    beside: float = setting(
        0.7,
        "How far beside the first performer's middle its own edge is, to the right as the sensor sees it.",
        unit="m",
    )
    mirror: bool = setting(True, "The character is like the performer's picture in a mirror.")
    extend: bool = setting(
        True, "Chains go on along the longest branch of what hangs on them; else that is carried rigidly."
    )
    fade: float = setting(0.6, "Seconds that a change takes to show.", unit="s", low=0.0, high=10.0)
    hand_over: float = setting(
        60.0,
        "Who alone drives nothing goes on for who has been away for longer; 0: only who takes hold.",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    listed: int = setting(6, "Matches told to viewers.", unit="matches", low=1, high=15)
    ranking: RankingSettings = setting(RankingSettings, "How matches are scored.")
    picking: PickingSettings = setting(PickingSettings, "When the shown match gives way, and is taken.")
