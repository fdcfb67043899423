from .choreographies import choreography as choreography
from .motion import Motion as Motion, placed as placed
