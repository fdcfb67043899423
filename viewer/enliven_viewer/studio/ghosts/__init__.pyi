from .ghosts import Ghosts as Ghosts
from .motion_samples import GhostSurface as GhostSurface
from .ghost_picture import (
    GhostBody as GhostBody,
    GhostPicture as GhostPicture,
    make_trail_rows as make_trail_rows,
)
