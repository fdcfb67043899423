from .app import App as App
from .hud import time_text as time_text
from .keys import KeyBindings as KeyBindings
from .match_cards import cards_of as cards_of, draw_cards as draw_cards
