from .performer_picture import PerformerPicture
from .performer_view import PerformerFigure, PerformerView
from .thumbnails import Thumbnails

__all__ = ["PerformerFigure", "PerformerPicture", "PerformerView", "Thumbnails"]
