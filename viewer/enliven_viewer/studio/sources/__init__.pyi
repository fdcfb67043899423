from .matches import Chain, Offer, accepted, offers, seen
from .source_view import SourceView

__all__ = ["Chain", "Offer", "SourceView", "accepted", "offers", "seen"]
