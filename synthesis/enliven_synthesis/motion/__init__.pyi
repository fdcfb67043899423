from .choreographies import get_choreography as get_choreography
from .motion import Motion as Motion, place_figure as place_figure
