"""What is drawn over a picture: flat shapes and text, glowing marks, lines of matches, tubes of graphs."""

from enliven_viewer.render.overlay.canvas import Canvas, Colour
from enliven_viewer.render.overlay.marks import CUE_RADIUS, Marks
from enliven_viewer.render.overlay.match_lines import TINTS, match_rows
from enliven_viewer.render.overlay.tubes import Tubes, tube_rows

__all__ = ["CUE_RADIUS", "TINTS", "Canvas", "Colour", "Marks", "Tubes", "match_rows", "tube_rows"]
