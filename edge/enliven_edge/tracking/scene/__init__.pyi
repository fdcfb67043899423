from .floor import correct_mounting as correct_mounting, world_from_floor as world_from_floor
from .mounting import Mounting as Mounting
from .background_model import BackgroundModel as BackgroundModel
from .background_kernels import (
    FOREGROUND as FOREGROUND,
    BACKGROUND as BACKGROUND,
    UNLIKELY as UNLIKELY,
    UNSEEN as UNSEEN,
    widened as widened,
)
from .walls import remove_walls as remove_walls
from .zone import Zone as Zone, ZoneLock as ZoneLock
