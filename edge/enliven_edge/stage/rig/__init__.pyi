from .rig_actor import RigActor as RigActor, cast_rig as cast_rig
from .settings import MatchingSettings as MatchingSettings
