from .floor import corrected, world_from_floor
from .mounting import Mounting
from .room import BEFORE, ROOM, UNLIKELY, UNSEEN, Room, widened
from .walls import without_walls
from .zone import Lock, Zone

__all__ = [
    "BEFORE",
    "ROOM",
    "UNLIKELY",
    "UNSEEN",
    "Lock",
    "Mounting",
    "Room",
    "Zone",
    "corrected",
    "widened",
    "without_walls",
    "world_from_floor",
]
