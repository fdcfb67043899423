from .calibration import Calibration, SensorPair, calibrate
from .collecting import Collector

__all__ = ["Calibration", "Collector", "SensorPair", "calibrate"]
