from .canvas import Canvas as Canvas, Pen as Pen
from .marks import CUE_RADIUS as CUE_RADIUS, Marks as Marks, cue_tints as cue_tints
from .match_lines import (
    limb_tints as limb_tints,
    match_rows as match_rows,
    tints_of as tints_of,
)
from .tubes import Tubes as Tubes, tube_rows as tube_rows
