from .film import make_film as make_film
from .graph_picture import write_graph_picture as write_graph_picture
from .project_film import write_project_film as write_project_film
from .project_sheet import write_project_sheet as write_project_sheet
from .sheet import Tiles as Tiles, write_sheet as write_sheet
