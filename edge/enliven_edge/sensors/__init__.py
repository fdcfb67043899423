"""Sensors: everything that delivers frames, by name, with reopening, health and recordings in place of
devices.

:func:`open_sensor` opens one by its name; other packages add sensors by the entry-point group
``enliven.sensors``.
"""

from enliven_edge.sensors import crash_reports
from enliven_edge.sensors.attached_cameras import attached
from enliven_edge.sensors.base import CHECK_IT, Condition, Sensor, SensorFault, condition_of
from enliven_edge.sensors.diary import Diary, Moment, Moments
from enliven_edge.sensors.options import sensor_options
from enliven_edge.sensors.profile import SensorProfile, load_profile, profile_names
from enliven_edge.sensors.registry import open_sensor, sensor_names, sensor_opener
from enliven_edge.sensors.reopening import kept_open

__all__ = [
    "CHECK_IT",
    "Condition",
    "Diary",
    "Moment",
    "Moments",
    "Sensor",
    "SensorFault",
    "SensorProfile",
    "attached",
    "condition_of",
    "crash_reports",
    "kept_open",
    "load_profile",
    "open_sensor",
    "profile_names",
    "sensor_names",
    "sensor_opener",
    "sensor_options",
]
