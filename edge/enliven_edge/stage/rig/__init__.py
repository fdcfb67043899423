"""Rigged models: a performer chooses a part of the skeleton by posing, and then drives it (AniMesh)."""

from enliven_edge.stage.rig.casting import cast_rig
from enliven_edge.stage.rig.settings import MatchingSettings

__all__ = ["MatchingSettings", "cast_rig"]
