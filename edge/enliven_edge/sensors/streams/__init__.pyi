from .tracker_sensor import TrackerSensor as TrackerSensor
from .vmc_sensor import VmcSensor as VmcSensor
