"""The second view: the performer at the moment that the puppet shows, and thumbnails of key poses."""

from enliven_viewer.studio.performer.performer_picture import PerformerPicture
from enliven_viewer.studio.performer.performer_view import Figure, PerformerView
from enliven_viewer.studio.performer.thumbnails import Thumbnails

__all__ = ["Figure", "PerformerPicture", "PerformerView", "Thumbnails"]
