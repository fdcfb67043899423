from .page import draw_start as draw_start
from .placing import place_arrow as place_arrow
from .placing import place_card as place_card
from .tour import draw_tour as draw_tour
