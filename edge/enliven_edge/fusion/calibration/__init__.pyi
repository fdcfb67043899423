from .calibration import Calibration, Pair, calibrate
from .collecting import Collector

__all__ = ["Calibration", "Collector", "Pair", "calibrate"]
