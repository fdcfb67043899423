from .film import make_film
from .graph_picture import write_graph_picture
from .sheet import Tiles, write_sheet

__all__ = ["Tiles", "make_film", "write_graph_picture", "write_sheet"]
