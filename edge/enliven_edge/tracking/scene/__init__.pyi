from .floor import corrected, world_from_floor
from .mounting import Mounting
from .room import BEFORE, ROOM, UNLIKELY, UNSEEN, RoomModel, widened
from .walls import without_walls
from .zone import Zone, ZoneLock

__all__ = [
    "BEFORE",
    "ROOM",
    "UNLIKELY",
    "UNSEEN",
    "Mounting",
    "RoomModel",
    "Zone",
    "ZoneLock",
    "corrected",
    "widened",
    "without_walls",
    "world_from_floor",
]
