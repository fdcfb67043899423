from .performer_picture import PerformerPicture as PerformerPicture
from .performer_view import PerformerFigure as PerformerFigure, PerformerView as PerformerView
from .thumbnails import SIDE as SIDE, Thumbnails as Thumbnails
