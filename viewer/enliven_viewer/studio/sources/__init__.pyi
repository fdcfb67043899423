from .matches import Chain, Offer, accepted, matching_view, offers
from .source_view import SourceView

__all__ = ["Chain", "Offer", "SourceView", "accepted", "matching_view", "offers"]
