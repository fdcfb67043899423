from .ghosts import Ghosts as Ghosts
from .sampling import MomentBody as MomentBody
from .picture import GhostBody as GhostBody, GhostPicture as GhostPicture, trail_rows as trail_rows
