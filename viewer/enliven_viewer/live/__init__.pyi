from .app import App
from .hud import ACCENT, BAD, GLASS, GOOD, INK, QUIET, WAIT, clock, wrapped
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
    "clock",
    "draw_cards",
    "wrapped",
]
