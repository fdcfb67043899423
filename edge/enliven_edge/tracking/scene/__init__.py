"""The scene without people: the sensor's mounting, the floor, walls, the background and the active zone."""

from enliven_edge.tracking.scene.floor import corrected, world_from_floor
from enliven_edge.tracking.scene.mounting import Mounting
from enliven_edge.tracking.scene.room import BEFORE, ROOM, UNLIKELY, UNSEEN, Room, widened
from enliven_edge.tracking.scene.walls import without_walls
from enliven_edge.tracking.scene.zone import Lock, Zone

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
