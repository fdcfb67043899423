"""Merges the body frames of live sensors into one stream in the world frame, with one clock and the fastest
frame rate.

The minimum age of a sensor's frames over an interval is its latency, which is constant. So if the difference
between the minimum ages of two sensors changes, one of their clocks drifts. Clocks drift apart by seconds per
day.
"""

from __future__ import annotations

import dataclasses
import logging
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.person import Body
from enliven.rotation import from_matrix, multiply
from enliven.space.rigid_transform import transform_points
from enliven.space.space_file import Space
from enliven_edge.tracking.settings import TrackerSettings

log = logging.getLogger(__name__)

_MAX_CLOCK_DIFFERENCE_NS = 300_000_000
"""Maximum difference in nanoseconds between the minimum frame ages of two sensors. A larger difference means
that the clocks have changed since the calibration."""
_AGE_INTERVAL_NS = 10_000_000_000
"""Interval in nanoseconds over which the minimum frame age is measured. It contains some hundred frames, and
clocks drift by less than a millisecond in it."""


@dataclass
class _Ages:
    """The minimum age of a sensor's frames in nanoseconds: in this interval, and in the last complete one."""

    started_ns: int
    minimum: int
    last_minimum: int | None = None


class ArrivalClocks:
    """Clock offsets of live sensors that are added to those of the calibration.

    The first sensor is the reference.
    """

    def __init__(self) -> None:
        self._ages: dict[str, _Ages] = {}
        self._shift: dict[str, int] = {}
        self._base: dict[str, int] = {}

    def shift(self, sensor: str) -> int:
        """Returns the nanoseconds to add to a sensor's time."""
        return self._shift.get(sensor, 0)

    def record_arrival(self, sensor: str, time_ns: int, read_ns: int) -> None:
        """Records the arrival of a frame.

        Args:
            sensor: the sensor's identity.
            time_ns: time of the frame, by the clock of the calibration.
            read_ns: time of its arrival, by the monotonic clock.
        """
        age = read_ns - time_ns
        ages = self._ages.setdefault(sensor, _Ages(read_ns, age))
        ages.minimum = min(ages.minimum, age)
        first = next(iter(self._ages))
        if sensor != first:
            self._set(sensor, ages, self._ages[first])
        if read_ns - ages.started_ns > _AGE_INTERVAL_NS:
            ages.last_minimum, ages.started_ns, ages.minimum = ages.minimum, read_ns, age

    def _set(self, sensor: str, ages: _Ages, first: _Ages) -> None:
        """Sets the shift of a sensor from the difference between its frame ages and those of the first
        sensor.
        """
        if ages.last_minimum is None or first.last_minimum is None:
            difference_ns = ages.minimum - first.minimum
            if abs(difference_ns - self.shift(sensor)) > _MAX_CLOCK_DIFFERENCE_NS:
                self._shift[sensor] = difference_ns
                log.warning(
                    "the clock of %s differs from its calibration; it is now set by the arrival times of "
                    "the frames",
                    sensor,
                )
            return
        difference_ns = ages.last_minimum - first.last_minimum
        base = self._base.setdefault(sensor, difference_ns - self.shift(sensor))
        self._shift[sensor] = difference_ns - base


_MAX_LEADER_DELAY = 1.7
"""Maximum delay of the leading sensor in frame intervals. After a longer delay another sensor leads."""
_FASTER_RATIO = 0.8
"""Another sensor becomes the leading one if its frame interval is below this fraction of the leading sensor's
interval."""


class OutputSchedule:
    """Decides when fused bodies are sent: with the frames of the fastest sensor, while it sends frames."""

    def __init__(self) -> None:
        self._steps: dict[str, float] = {}
        self._last: dict[str, int] = {}
        self._leader: str | None = None
        self._last_sent_ns: int | None = None

    def is_due(self, sensor: str, time_ns: int) -> bool:
        """Returns True if fused bodies are due with this frame of a sensor (time of the common clock)."""
        previous_ns = self._last.get(sensor, time_ns)
        if time_ns > previous_ns:
            step = (time_ns - previous_ns) * 1e-9
            self._steps[sensor] = step + 0.9 * (self._steps.get(sensor, step) - step)
        self._last[sensor] = max(time_ns, previous_ns)
        if self._leader is None or self._should_lead(sensor, time_ns):
            self._leader = sensor
        if sensor != self._leader or (self._last_sent_ns is not None and time_ns <= self._last_sent_ns):
            return False
        self._last_sent_ns = time_ns
        return True

    def _should_lead(self, sensor: str, time_ns: int) -> bool:
        """Returns True if a sensor should lead: it is faster than the leading one, or the leading one is
        late.
        """
        assert self._leader is not None
        if self._leader not in self._steps:
            return time_ns - self._last[self._leader] > 1e8
        step = self._steps[self._leader]
        leader_delay = (time_ns - self._last[self._leader]) * 1e-9 > _MAX_LEADER_DELAY * step
        return leader_delay or self._steps.get(sensor, np.inf) < _FASTER_RATIO * step


_FIXED_HEIGHT_M = 1.0
"""Height in metres of a sensor that sees no floor and has no height in the settings. It is the same in every
session."""


def settings_before_fusion(settings: TrackerSettings) -> TrackerSettings:
    """Returns settings for a tracker that sends its bodies to the fuser.

    Smoothing, mirroring and prediction are off, because they are applied after fusion. The sensor's height
    without a floor is fixed and not guessed from people, because the sensors were calibrated with this
    height.
    """
    smoothing = dataclasses.replace(settings.smoothing, amount=0.0, amounts=())
    output = dataclasses.replace(settings.output, mirror=False, predict=0.0)
    scene = dataclasses.replace(settings.scene, height=settings.scene.height or _FIXED_HEIGHT_M)
    return dataclasses.replace(settings, scene=scene, smoothing=smoothing, output=output)


def transform_bodies(bodies: list[Body], world_from_sensor: Float) -> list[Body]:
    """Transforms the bodies from a sensor's level frame to the world."""
    rotation = from_matrix(world_from_sensor[:3, :3])
    return [
        dataclasses.replace(
            body,
            joints=transform_points(world_from_sensor, body.joints),
            orientations=None if body.orientations is None else multiply(rotation, body.orientations),
        )
        for body in bodies
    ]


def sensor_positions(space: Space) -> dict[str, Float]:
    """Returns by sensor (3,) the position of its optical centre in the world, in metres."""
    return {name: place.eye for name, place in space.sensors.items()}
