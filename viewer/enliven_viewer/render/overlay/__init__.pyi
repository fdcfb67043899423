from .canvas import Canvas
from .marks import CUE_RADIUS, Marks
from .match_lines import TINTS, match_rows
from .tubes import Tubes, tube_rows

__all__ = ["CUE_RADIUS", "TINTS", "Canvas", "Marks", "Tubes", "match_rows", "tube_rows"]
