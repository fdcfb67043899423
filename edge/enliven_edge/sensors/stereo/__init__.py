"""Two cameras as a depth sensor: their calibration, and depth from their images."""

from enliven_edge.sensors.stereo.calibration import (
    StereoCalibration,
    StereoLens,
    load_calibration,
    save_calibration,
)
from enliven_edge.sensors.stereo.matching import StereoMatcher
from enliven_edge.sensors.stereo.pair_folder import RecordedPairs, image_pairs, read_grey
from enliven_edge.sensors.stereo.pairing import Pairing, Picture
from enliven_edge.sensors.stereo.rectifying import Rectification

__all__ = [
    "Pairing",
    "Picture",
    "RecordedPairs",
    "Rectification",
    "StereoCalibration",
    "StereoLens",
    "StereoMatcher",
    "image_pairs",
    "load_calibration",
    "read_grey",
    "save_calibration",
]
