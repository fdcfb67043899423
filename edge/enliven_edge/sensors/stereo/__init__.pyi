from .board import CalibrationBoard
from .calibration import load_calibration, save_calibration
from .collecting import Keeper
from .judging import Judgement, judge
from .matching import StereoMatcher
from .opencv_library import opencv
from .pair_folder import RecordedPairs, image_pairs, read_grey
from .pairing import CameraImage, Pairing
from .rectifying import Rectification
from .solving import BoardSighting, solve

__all__ = [
    "BoardSighting",
    "CalibrationBoard",
    "CameraImage",
    "Judgement",
    "Keeper",
    "Pairing",
    "RecordedPairs",
    "Rectification",
    "StereoMatcher",
    "image_pairs",
    "judge",
    "load_calibration",
    "opencv",
    "read_grey",
    "save_calibration",
    "solve",
]
