from .bvh import read_bvh
from .capture import UNITS, Capture, guess_unit
from .expmap import COLUMNS, read_expmap

__all__ = ["COLUMNS", "UNITS", "Capture", "guess_unit", "read_bvh", "read_expmap"]
