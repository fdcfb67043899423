from .app import App
from .hud import ACCENT, BAD, GLASS, GOOD, INK, QUIET, WAIT, time_text, wrapped
from .keys import KeyBindings
from .match_cards import cards_of, draw_cards

__all__ = [
    "ACCENT",
    "BAD",
    "GLASS",
    "GOOD",
    "INK",
    "QUIET",
    "WAIT",
    "App",
    "KeyBindings",
    "cards_of",
    "draw_cards",
    "time_text",
    "wrapped",
]
