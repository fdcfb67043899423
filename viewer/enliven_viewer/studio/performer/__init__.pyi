from .performer_picture import PerformerPicture
from .performer_view import Figure, PerformerView
from .thumbnails import Thumbnails

__all__ = ["Figure", "PerformerPicture", "PerformerView", "Thumbnails"]
