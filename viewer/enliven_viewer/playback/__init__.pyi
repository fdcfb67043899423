from .document import Document, EdgeState, bounds_of
from .playhead import Playhead
from .solved_surfaces import SolvedSurfaces
from .timeline import NS, CueFrame, Timeline, TimelineMoment

__all__ = [
    "NS",
    "CueFrame",
    "Document",
    "EdgeState",
    "Playhead",
    "SolvedSurfaces",
    "Timeline",
    "TimelineMoment",
    "bounds_of",
]
