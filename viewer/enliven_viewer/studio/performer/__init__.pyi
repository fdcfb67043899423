from .performer_picture import PerformerPicture
from .performer_view import PerformerFigure, PerformerView
from .thumbnails import SIDE, Thumbnails

__all__ = ["SIDE", "PerformerFigure", "PerformerPicture", "PerformerView", "Thumbnails"]
