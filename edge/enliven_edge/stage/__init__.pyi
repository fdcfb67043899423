from .character_setup import (
    create_actor as create_actor,
    create_mesh_actor as create_mesh_actor,
    name_of as name_of,
    parts_for as parts_for,
)
from .hold_memory import HoldStarts as HoldStarts
from .initial_possession import InitialPossession as InitialPossession
from .stage_capacity import Peer as Peer, StageSettings as StageSettings
from .sizing import HandSizing as HandSizing
from .stage import Stage as Stage
from .tick import Tick as Tick
