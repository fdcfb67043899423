"""Calibration of several sensors from a person who walks about: no board and no tape measure.

Joints that two sensors see at once give the transform between them, a pose graph joins the pairs, and the
quality is stated in words.
"""

from enliven_edge.fusion.calibration.calibration import Calibration, Pair, calibrate
from enliven_edge.fusion.calibration.collecting import Collector

__all__ = ["Calibration", "Collector", "Pair", "calibrate"]
