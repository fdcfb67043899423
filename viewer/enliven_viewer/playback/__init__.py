"""Playback: the document of what is shown, its timeline, and poses between two messages."""

from enliven_viewer.playback.document import Document, EdgeState, bounds_of
from enliven_viewer.playback.playhead import Playhead
from enliven_viewer.playback.solved_surfaces import Surfaces
from enliven_viewer.playback.timeline import NS, Cues, Moment, Timeline

__all__ = ["NS", "Cues", "Document", "EdgeState", "Moment", "Playhead", "Surfaces", "Timeline", "bounds_of"]
