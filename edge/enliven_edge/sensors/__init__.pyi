from . import crash_reports
from .attached_cameras import attached
from .base import CHECK_IT, Condition, Sensor, SensorFault, condition_of, health_of
from .diary import Diary, DiaryEntries, DiaryEntry
from .options import sensor_options
from .profile import SensorProfile, load_profile, profile_names
from .registry import open_sensor, sensor_advice, sensor_names, sensor_opener
from .reopening import kept_open

__all__ = [
    "CHECK_IT",
    "Condition",
    "Diary",
    "DiaryEntries",
    "DiaryEntry",
    "Sensor",
    "SensorFault",
    "SensorProfile",
    "attached",
    "condition_of",
    "crash_reports",
    "health_of",
    "kept_open",
    "load_profile",
    "open_sensor",
    "profile_names",
    "sensor_advice",
    "sensor_names",
    "sensor_opener",
    "sensor_options",
]
