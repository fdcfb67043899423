"""Aligns live sensors' clocks by the arrival of their frames: anew after a restart, and against drift.

The age of the youngest frame over a while is the sensor's latency, which is constant. A change of the
difference between two sensors' youngest frames is therefore one of their clocks, which drift apart by
seconds a day.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

log = logging.getLogger(__name__)

_DIFFER_NS = 300_000_000
"""Difference of two sensors' youngest frames beyond which the clocks are not those of the calibration."""
_WHILE_NS = 10_000_000_000
"""Nanoseconds over which the youngest frame is taken: some hundred frames, in which clocks drift by less than
a millisecond."""


@dataclass
class _Ages:
    """The least age of a sensor's frames, nanoseconds: in this interval, and in the last whole one."""

    began_ns: int
    least: int
    settled: int | None = None


class ArrivalClocks:
    """Offsets of every live sensor's time, beyond the calibration's; the first sensor's stays."""

    def __init__(self) -> None:
        self._ages: dict[str, _Ages] = {}
        self._shift: dict[str, int] = {}
        self._base: dict[str, int] = {}

    def shift(self, sensor: str) -> int:
        """Returns the nanoseconds to add to a sensor's time."""
        return self._shift.get(sensor, 0)

    def note(self, sensor: str, time_ns: int, read_ns: int) -> None:
        """Takes in the arrival of a frame.

        Args:
            time_ns: of the frame, by the calibration's clock.
            read_ns: wall clock.
        """
        age = read_ns - time_ns
        ages = self._ages.setdefault(sensor, _Ages(read_ns, age))
        ages.least = min(ages.least, age)
        first = next(iter(self._ages))
        if sensor != first:
            self._set(sensor, ages, self._ages[first])
        if read_ns - ages.began_ns > _WHILE_NS:
            ages.settled, ages.began_ns, ages.least = ages.least, read_ns, age

    def _set(self, sensor: str, ages: _Ages, first: _Ages) -> None:
        """Sets the shift by comparing the ages with those of the first sensor."""
        if ages.settled is None or first.settled is None:
            apart = ages.least - first.least
            if abs(apart - self.shift(sensor)) > _DIFFER_NS:
                self._shift[sensor] = apart
                log.warning("the clock of %s is not that of its calibration; set by arrival", sensor)
            return
        apart = ages.settled - first.settled
        base = self._base.setdefault(sensor, apart - self.shift(sensor))
        self._shift[sensor] = apart - base
