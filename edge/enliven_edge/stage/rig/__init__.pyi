from .casting import cast_rig as cast_rig
from .rig_actor import RigActor as RigActor
from .settings import MatchingSettings as MatchingSettings
