from .hud import (
    Hud as Hud,
    HudState as HudState,
    late_words as late_words,
    time_text as time_text,
    timeline_area as timeline_area,
    timeline_fraction as timeline_fraction,
)

from .live_stage import LiveStage as LiveStage
from .idle_loop import IdleLoop as IdleLoop
from .performer_numbers import PerformerNumbers as PerformerNumbers
from .possession_choice import PARTS as PARTS, SMOOTHING as SMOOTHING
from .match_cards import cards_of as cards_of, draw_cards as draw_cards
