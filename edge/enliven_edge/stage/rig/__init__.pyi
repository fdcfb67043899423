from .rig_actor import RigActor as RigActor, create_rig_actor as create_rig_actor
from .settings import MatchingSettings as MatchingSettings
