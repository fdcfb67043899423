from .board import Board
from .calibration import load_calibration, save_calibration
from .collecting import Keeper
from .judging import Judgement, judge
from .matching import StereoMatcher
from .opencv_library import opencv
from .pair_folder import RecordedPairs, image_pairs, read_grey
from .pairing import Pairing, Picture
from .rectifying import Rectification
from .solving import Sighting, solve

__all__ = [
    "Board",
    "Judgement",
    "Keeper",
    "Pairing",
    "Picture",
    "RecordedPairs",
    "Rectification",
    "Sighting",
    "StereoMatcher",
    "image_pairs",
    "judge",
    "load_calibration",
    "opencv",
    "read_grey",
    "save_calibration",
    "solve",
]
