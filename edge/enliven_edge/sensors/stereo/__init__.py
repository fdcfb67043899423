"""Two cameras as a depth sensor: their calibration from a printed board, and depth from their images."""

from enliven_edge.sensors.stereo.board import Board
from enliven_edge.sensors.stereo.calibration import load_calibration, save_calibration
from enliven_edge.sensors.stereo.collecting import Keeper
from enliven_edge.sensors.stereo.judging import Judgement, judge
from enliven_edge.sensors.stereo.matching import StereoMatcher
from enliven_edge.sensors.stereo.opencv_library import opencv
from enliven_edge.sensors.stereo.pair_folder import RecordedPairs, image_pairs, read_grey
from enliven_edge.sensors.stereo.pairing import Pairing, Picture
from enliven_edge.sensors.stereo.rectifying import Rectification
from enliven_edge.sensors.stereo.solving import Sighting, solve

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
