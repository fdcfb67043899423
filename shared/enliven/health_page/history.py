"""The history of measured values over the last day, one per minute. It is kept in memory, and in a file so
that it survives restarts."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping
from pathlib import Path

import msgspec

from enliven.errors import InputError
from enliven.files import DECODE_ERRORS, read_file, write_file

SAMPLE_INTERVAL_S = 60.0
"""Time between two stored values, in seconds."""
CAPACITY_MINUTES = 1440
"""Number of stored values of each series: one per minute for a day."""
MAX_SERIES = 500
"""Maximum number of series. They take 3 MB in total. Further series are not stored."""
_MAX_FILE_BYTES = 16 << 20
"""Maximum size in bytes of a file that is read. A file with :data:`MAX_SERIES` series has 3 MB."""
_VERSION = 1
"""Version of the file format. A file of another version is ignored and replaced."""
_VALUE_BYTES = 4
"""Size of a stored value in bytes."""
_TIMESTAMP_BYTES = 8
"""Size of a stored minute number in bytes."""
_NO_MINUTE = -1
"""Minute number of a slot without values."""


class _HistoryFile(msgspec.Struct, frozen=True):
    """The content of the file: minutes as int64, and the values of each series as float32."""

    version: int
    minutes: bytes
    series: dict[str, bytes]


class DayHistory:
    """The values of the last day in a ring buffer with one slot per minute, which all series share.

    The slot follows from the number of the minute since 1970. So a jump of the clock causes gaps, but does
    not shift values.
    """

    def __init__(self) -> None:
        self._minutes = array("q", [_NO_MINUTE]) * CAPACITY_MINUTES
        self._series: dict[str, array[float]] = {}
        self._sums: dict[str, tuple[float, int]] = {}
        self._minute = _NO_MINUTE

    @property
    def names(self) -> list[str]:
        """The names of all series."""
        return sorted(self._series)

    def add(self, at_s: float, values: Mapping[str, float | None]) -> bool:
        """Adds measured values. The mean of each minute is stored when the next minute begins.

        Args:
            at_s: Unix time in seconds.
            values: the values by name of the series. None and NaN are left out.

        Returns:
            True if a minute was stored.
        """
        minute = math.floor(at_s / SAMPLE_INTERVAL_S)
        is_new = minute != self._minute
        has_stored = is_new and self._store_minute()
        if is_new:
            self._minute = minute
        for name, value in values.items():
            if value is not None and math.isfinite(value):
                total, count = self._sums.get(name, (0.0, 0))
                self._sums[name] = (total + value, count + 1)
        return has_stored

    def read(self, name: str, at_s: float, points: int = CAPACITY_MINUTES) -> list[float]:
        """Returns the values of a series over the last day, the oldest first. NaN means that there is no
        value.

        Args:
            at_s: Unix time of the newest value, in seconds.
            points: number of returned values. Each is the mean over an equal number of minutes.
        """
        values = self._series.get(name)
        if values is None:
            return [math.nan] * points
        last = math.floor(at_s / SAMPLE_INTERVAL_S)
        span = CAPACITY_MINUTES // points
        return [
            _mean(
                [self._get_value(values, last - CAPACITY_MINUTES + 1 + point * span + k) for k in range(span)]
            )
            for point in range(points)
        ]

    def load(self, path: Path) -> None:
        """Reads the values from a file. A file that is missing, damaged or of a later version is ignored."""
        try:
            content = msgspec.msgpack.decode(read_file(path, _MAX_FILE_BYTES), type=_HistoryFile)
        except (InputError, *DECODE_ERRORS):
            return
        sizes = {len(data) for data in content.series.values()} | {CAPACITY_MINUTES * _VALUE_BYTES}
        if (
            content.version != _VERSION
            or len(content.minutes) != CAPACITY_MINUTES * _TIMESTAMP_BYTES
            or len(sizes) != 1
        ):
            return
        self._minutes = array("q", content.minutes)
        self._series = {
            name[:200]: array("f", data) for name, data in list(content.series.items())[:MAX_SERIES]
        }

    def save(self, path: Path) -> None:
        """Writes all values, completely or not at all. Series without values of the last day are left out.

        Raises:
            ResourceError: if the file cannot be written.
        """
        self._store_minute()
        self._series = {name: values for name, values in self._series.items() if not _is_empty(values)}
        series = {name: values.tobytes() for name, values in self._series.items()}
        path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, msgspec.msgpack.encode(_HistoryFile(_VERSION, self._minutes.tobytes(), series)))

    def _store_minute(self) -> bool:
        """Stores the means of the current minute. Returns True if there were any values."""
        if not self._sums:
            return False
        slot = self._minute % CAPACITY_MINUTES
        if self._minutes[slot] != self._minute:
            self._minutes[slot] = self._minute
            for values in self._series.values():
                values[slot] = math.nan
        for name, (total, count) in self._sums.items():
            if name not in self._series and len(self._series) < MAX_SERIES:
                self._series[name] = array("f", [math.nan]) * CAPACITY_MINUTES
            if name in self._series:
                self._series[name][slot] = total / count
        self._sums = {}
        return True

    def _get_value(self, values: array[float], minute: int) -> float:
        """Returns the value of a minute, or NaN if none was stored."""
        slot = minute % CAPACITY_MINUTES
        return values[slot] if self._minutes[slot] == minute else math.nan


def _mean(values: list[float]) -> float:
    """Returns the mean of the values that are not NaN."""
    finite = [value for value in values if not math.isnan(value)]
    return sum(finite) / len(finite) if finite else math.nan


def _is_empty(values: array[float]) -> bool:
    """Returns True if a series has no value."""
    return all(math.isnan(value) for value in values)
