from . import crash_reports as crash_reports
from .attached_cameras import list_attached as list_attached
from .base import (
    CHECK_IT as CHECK_IT,
    Condition as Condition,
    Sensor as Sensor,
    SensorFault as SensorFault,
)
from .camera_list import DetectedCamera as DetectedCamera, find_cameras as find_cameras
from .event_log import EventLog as EventLog, LogReader as LogReader, LogEntry as LogEntry
from .registry import sensor_options as sensor_options
from .power_cycle import CameraPower as CameraPower
from .profile import profile_names as profile_names, profiles_folder as profiles_folder
from .registry import (
    open_sensor as open_sensor,
    sensor_advice as sensor_advice,
    sensor_names as sensor_names,
    sensor_opener as sensor_opener,
)
from .reopening import open_reopening as open_reopening
