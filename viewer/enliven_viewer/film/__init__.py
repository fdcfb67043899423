"""Films and picture sheets of what the viewer shows, encoded beside the drawing."""

from enliven_viewer.film.encoder import FilmWriter
from enliven_viewer.film.film import make_film
from enliven_viewer.film.graph_picture import write_graph_picture
from enliven_viewer.film.sheet import Tiles, write_sheet

__all__ = ["FilmWriter", "Tiles", "make_film", "write_graph_picture", "write_sheet"]
