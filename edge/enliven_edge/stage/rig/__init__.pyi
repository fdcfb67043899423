from .rig_actor import cast_rig as cast_rig
from .settings import MatchingSettings as MatchingSettings
