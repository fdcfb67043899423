from .casting import cast_rig
from .settings import MatchingSettings

__all__ = ["MatchingSettings", "cast_rig"]
