"""The live window: keys, captions and cards over the stage."""

from enliven_viewer.live.app import App
from enliven_viewer.live.hud import ACCENT, BAD, GLASS, GOOD, INK, QUIET, WAIT, clock, wrapped
from enliven_viewer.live.keys import Controls
from enliven_viewer.live.match_cards import cards_of, draw_cards

__all__ = [
    "ACCENT",
    "BAD",
    "GLASS",
    "GOOD",
    "INK",
    "QUIET",
    "WAIT",
    "App",
    "Controls",
    "cards_of",
    "clock",
    "draw_cards",
    "wrapped",
]
