from .board import CalibrationBoard as CalibrationBoard
from .calibration import load_calibration as load_calibration, save_calibration as save_calibration
from .judging import Keeper as Keeper
from .judging import Judgement as Judgement, judge as judge
from .matching import StereoMatcher as StereoMatcher
from .rectifying import opencv as opencv
from .pair_folder import RecordedPairs as RecordedPairs, image_pairs as image_pairs, read_grey as read_grey
from .pairing import CameraImage as CameraImage, Pairing as Pairing
from .rectifying import Rectification as Rectification
from .solving import BoardSighting as BoardSighting, solve as solve
