from .choreographies import choreography
from .motion import Motion, placed

__all__ = ["Motion", "choreography", "placed"]
