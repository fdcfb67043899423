from .floor import corrected as corrected, world_from_floor as world_from_floor
from .mounting import Mounting as Mounting
from .room import RoomModel as RoomModel
from .room_kernels import (
    BEFORE as BEFORE,
    ROOM as ROOM,
    UNLIKELY as UNLIKELY,
    UNSEEN as UNSEEN,
    widened as widened,
)
from .walls import without_walls as without_walls
from .zone import Zone as Zone, ZoneLock as ZoneLock
