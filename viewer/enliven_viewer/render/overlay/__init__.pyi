from .canvas import Canvas as Canvas, Pen as Pen
from .marks import CUE_RADIUS as CUE_RADIUS, Marks as Marks, find_cue_tints as find_cue_tints
from .match_lines import (
    find_limb_tints as find_limb_tints,
    make_match_rows as make_match_rows,
    find_tints as find_tints,
)
from .tubes import Tubes as Tubes, make_tube_rows as make_tube_rows
