from .calibration import Calibration as Calibration, SensorPair as SensorPair, calibrate as calibrate
from .tracks import Collector as Collector
