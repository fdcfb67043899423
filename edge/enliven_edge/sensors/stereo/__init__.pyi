from .board import CalibrationBoard as CalibrationBoard
from .calibration import load_calibration as load_calibration, save_calibration as save_calibration
from .calibration_quality import PairSelector as PairSelector
from .calibration_quality import CalibrationQuality as CalibrationQuality, judge as judge
from .matching import StereoMatcher as StereoMatcher
from .rectification import opencv as opencv
from .pair_folder import RecordedPairs as RecordedPairs, image_pairs as image_pairs, read_grey as read_grey
from .pairing import CameraImage as CameraImage, Pairing as Pairing
from .rectification import Rectification as Rectification
from .stereo_solver import BoardSighting as BoardSighting, solve as solve
