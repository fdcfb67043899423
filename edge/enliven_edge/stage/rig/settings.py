"""Settings of how a part of a rigged character is chosen and driven."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.matching.picking import PickingSettings
from enliven.matching.ranking import RankingSettings
from enliven.settings import group, parameter, setting


@dataclass(frozen=True)
class MatchingSettings:
    """Settings of choosing by posing and animating by moving."""

    height: float = setting(
        1.2, "Height to which the model is scaled. 0 keeps the modelled size.", unit="m", low=0.0, high=100.0
    )
    beside: float = setting(
        0.7,
        "Distance from the first performer's centre to the near edge of the character, to the right as "
        "the sensor sees it.",
        unit="m",
    )
    mirror: bool = setting(True, "Moves the character like the performer's mirror image.")
    extend: bool = setting(
        True, "Extends chains along the longest branch below them. If false, that branch moves rigidly."
    )
    fade: float = setting(
        0.6,
        "Duration of the blend after any change of the performers that drive the character.",
        unit="s",
        low=0.0,
        high=10.0,
    )
    hand_over: float = setting(
        60.0,
        "If a performer is away for longer, and exactly one performer without a character is in view, "
        "that performer takes over. 0 turns this off.",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    listed: int = parameter(6, "Number of matches that are sent to viewers.", unit="matches", low=1, high=15)
    ranking: RankingSettings = group(RankingSettings, "Scoring of matches.")
    picking: PickingSettings = group(
        PickingSettings, "When the shown match changes, and when it is accepted."
    )
