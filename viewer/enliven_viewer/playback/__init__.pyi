from .document import Document, EdgeState, bounds_of
from .playhead import Playhead
from .solved_surfaces import Surfaces
from .timeline import NS, Cues, Moment, Timeline

__all__ = ["NS", "Cues", "Document", "EdgeState", "Moment", "Playhead", "Surfaces", "Timeline", "bounds_of"]
