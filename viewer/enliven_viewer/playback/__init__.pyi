from .document import Document as Document, EdgeState as EdgeState, find_bounds as find_bounds
from .playhead import Playhead as Playhead
from .solved_surfaces import SolvedSurfaces as SolvedSurfaces
from .timeline import (
    NS_PER_S as NS_PER_S,
    CueFrame as CueFrame,
    Timeline as Timeline,
    TimelineMoment as TimelineMoment,
)
