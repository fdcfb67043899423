from .document import Document as Document, EdgeState as EdgeState, bounds_of as bounds_of
from .playhead import Playhead as Playhead
from .solved_surfaces import SolvedSurfaces as SolvedSurfaces
from .timeline import NS as NS, CueFrame as CueFrame, Timeline as Timeline, TimelineMoment as TimelineMoment
