"""Sources of motion: a take's skeleton beside the shapes, and the parts that it could drive."""

from enliven_viewer.studio.sources.matches import Chain, Offer, accepted, offers, seen
from enliven_viewer.studio.sources.source_view import SourceView

__all__ = ["Chain", "Offer", "SourceView", "accepted", "offers", "seen"]
