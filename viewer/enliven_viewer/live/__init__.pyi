from .hud import (
    Hud as Hud,
    HudState as HudState,
    describe_delay as describe_delay,
    format_time as format_time,
    timeline_area as timeline_area,
    timeline_fraction as timeline_fraction,
)

from .live_stage import LiveStage as LiveStage
from .idle_loop import IdleLoop as IdleLoop
from .performer_numbers import PerformerNumbers as PerformerNumbers
from .possession_choice import PART_CHOICES as PART_CHOICES, SMOOTHING_AMOUNTS as SMOOTHING_AMOUNTS
from .match_cards import make_cards as make_cards, draw_cards as draw_cards
