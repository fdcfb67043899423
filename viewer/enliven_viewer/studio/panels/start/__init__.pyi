from .page import draw_start as draw_start
from .card_placement import place_arrow as place_arrow
from .card_placement import place_card as place_card
from .tour import draw_tour as draw_tour
