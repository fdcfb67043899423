from .calibration import Calibration as Calibration, SensorPair as SensorPair, calibrate as calibrate
from .collecting import Collector as Collector
