"""Health from the device's own reports: its link, its temperature, and the direction of gravity."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.health import HealthKind
from enliven_edge.sensors import Condition
from enliven_edge.tracking.health.alarm import Alarms

_HOT_MARGIN_C = 5.0
"""A device counts as hot if it is less than this margin below its temperature limit, in degrees Celsius. The
margin leaves time to act."""
_LEVEL_ANGLE_DEG = 4.0
"""Angle in degrees between the detected floor and the accelerometer's level below which they agree again.
Mounting error and bias are 1 to 3 degrees."""
_TILTED_ANGLE_DEG = 6.0
"""Angle in degrees between the detected floor and the accelerometer's level above which they disagree. The
cause is usually a ramp or a table's edge that was mistaken for the floor."""
_UPSIDE_DOWN_COSINE = -0.5
"""Cosine between assumed and measured gravity below which a sensor hangs upside down: 120 degrees."""


def check_condition(
    alarms: Alarms, condition: Condition, world_from_camera: Float, floor_known: bool, now: int
) -> None:
    """Updates the alarms of a device.

    Args:
        alarms: the alarms to update.
        condition: the device's report.
        world_from_camera: (4, 4) pose of the sensor, from its floor or the settings.
        floor_known: whether the sensor's floor was detected.
        now: nanoseconds, the sensor's clock.
    """
    alarms.update(HealthKind.SLOW_LINK, condition.slow_link, now, link=condition.link or "a slow link")
    alarms.update(HealthKind.NOT_CALIBRATED, not condition.calibrated, now)
    if condition.temperature is not None and condition.hot is not None:
        room = condition.hot - condition.temperature
        hot = alarms.is_too_low(HealthKind.HOT, room, 2 * _HOT_MARGIN_C, _HOT_MARGIN_C)
        alarms.update(HealthKind.HOT, hot, now, celsius=condition.temperature, limit=condition.hot)
    down = condition.down
    if down is None:
        return
    agreement = float(-np.asarray(world_from_camera)[1, :3] @ down)
    alarms.update(HealthKind.UPSIDE_DOWN, agreement < _UPSIDE_DOWN_COSINE, now)
    tilt = float(np.degrees(np.arccos(np.clip(agreement, -1.0, 1.0)))) if floor_known else None
    level = alarms.is_too_low(
        HealthKind.NOT_LEVEL, None if tilt is None else -tilt, -_LEVEL_ANGLE_DEG, -_TILTED_ANGLE_DEG
    )
    alarms.update(HealthKind.NOT_LEVEL, level, now, degrees=tilt or 0.0)
