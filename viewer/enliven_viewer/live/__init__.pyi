from .app import App
from .hud import time_text
from .keys import KeyBindings
from .match_cards import cards_of, draw_cards

__all__ = [
    "App",
    "KeyBindings",
    "cards_of",
    "draw_cards",
    "time_text",
]
