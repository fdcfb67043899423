from .actor import Actor
from .actor_settings import ActorSettings
from .casting import cast, name_of, parts_for
from .highlights import Cues
from .opening import Opening
from .placement import facing
from .stage import Stage
from .tick import Tick

__all__ = [
    "Actor",
    "ActorSettings",
    "Cues",
    "Opening",
    "Stage",
    "Tick",
    "cast",
    "facing",
    "name_of",
    "parts_for",
]
