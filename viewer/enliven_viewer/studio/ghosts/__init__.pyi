from .ghosts import Ghosts as Ghosts
from .motion_samples import GhostSurface as GhostSurface
from .ghost_picture import GhostBody as GhostBody, GhostPicture as GhostPicture, trail_rows as trail_rows
