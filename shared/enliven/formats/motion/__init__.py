"""Motion captures: BVH files and CMU's exponential maps."""

from enliven.formats.motion.bvh import read_bvh
from enliven.formats.motion.capture import UNITS, Capture, guess_unit
from enliven.formats.motion.expmap import COLUMNS, read_expmap

__all__ = ["COLUMNS", "UNITS", "Capture", "guess_unit", "read_bvh", "read_expmap"]
