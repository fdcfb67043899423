"""Reads skeletons of several Kinect v2 and several people, as KinectMultiTrack writes them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from enliven.arrays import Bool, Float
from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.person import Body
from enliven_edge.importing.base import (
    DEFAULT_OPTIONS,
    FileReader,
    ImportOptions,
    check_row_lengths,
    first_lines,
    numbers_from_rows,
    read_head,
    read_rows,
)
from enliven_edge.importing.skeletons import (
    KINECT2_NAMES,
    TRACKED,
    WORLD_FROM_KINECT_SPACE,
    SkeletonMoment,
    frames_in_world,
    mask_missing,
)

_TICKS = {"Tracker_Time": 1e6, "Skeleton_Time": 100.0}
"""Nanoseconds per unit of each time column.

One column is the computer's clock, common to all Kinects. The other is each Kinect's own clock."""
_KEYS = ("Tracker_Time", "Person_Id", "Kinect_Id")
_FIRST_ROW = 2
"""The line of the first row, for messages. The header is line 1."""


class MultiTrackReader(FileReader):
    """Reads KinectMultiTrack CSV.

    A file has a header, and one row for each time, person and Kinect, with 25 joints in alphabetical order.

    Each Kinect has its own coordinate system. So only one is read: ``options.device``, or the one with the
    most rows. Times are relative to the first row, because the files count milliseconds since the year 1,
    which would overflow 64-bit nanoseconds.
    """

    name = "multitrack"
    description = "KinectMultiTrack CSV (several Kinect v2, several people); --device chooses the Kinect"
    note = "the file contains no tracking states, so every joint counts as tracked"

    clock = "Tracker_Time"
    """The column with the times at which the computer received the skeletons. "Skeleton_Time" is the time of
    capture by the Kinect's own clock, which is up to ten milliseconds earlier."""

    def matches(self, path: Path) -> bool:
        """Returns True if the header has the columns of times, persons, Kinects and joints."""
        header = (first_lines(read_head(path), 1) or [""])[0]
        return all(f"{name}," in header for name in (*_KEYS, "SpineBase_X"))

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[BodyFrame]:
        """Yields the bodies that one Kinect measured, grouped by time. An incomplete last row is ignored.

        Raises:
            InputError: for a missing column, a row of another length, or an unknown Kinect.
        """
        path = self.choose_file(paths)
        header, *rows = read_rows(path)
        column = {name.strip(): index for index, name in enumerate(header)}
        columns = [self.clock, *_KEYS[1:], *(f"{joint}_{axis}" for joint in KINECT2_NAMES for axis in "XYZ")]
        missing_columns = [name for name in columns if name not in column]
        if missing_columns:
            raise InputError(f"the column {missing_columns[0]} is missing", where=str(path))
        rows = rows[:-1] if rows and len(rows[-1]) != len(header) else rows
        check_row_lengths(rows, path, len(header), _FIRST_ROW)
        device = _choose_device(Counter(row[column["Kinect_Id"]] for row in rows), options.device, path)
        if self.clock != _KEYS[0]:
            rows = [row for row in rows if row[column["Kinect_Id"]] == device]
        chosen_rows = [[row[column[name]] for name in columns if name != "Kinect_Id"] for row in rows]
        values = numbers_from_rows(chosen_rows, path, len(columns) - 1, _FIRST_ROW)
        if not np.isfinite(values[:, :2]).all():
            raise InputError("a row has no time or no person", where=str(path), remedy="Remove the row.")
        is_chosen = np.array([row[column["Kinect_Id"]] == device for row in rows])
        moments = _group_moments(values, is_chosen, _TICKS[self.clock])
        return frames_in_world(moments, f"kinect2-{device}", WORLD_FROM_KINECT_SPACE, str(path))


def _group_moments(values: Float, is_chosen: Bool, tick: float) -> list[SkeletonMoment]:
    """Groups rows of time, person and 20 x 3 joints by time. Another Kinect's rows contribute only the time.

    Args:
        tick: nanoseconds per unit of the time column.
    """
    order = np.argsort(values[:, 0], kind="stable")
    moments: list[SkeletonMoment] = []
    for row, is_chosen_row in zip(values[order], is_chosen[order], strict=True):
        time_ns = round((row[0] - values[order[0], 0]) * tick)
        if not moments or moments[-1].time_ns != time_ns:
            moments.append(SkeletonMoment(time_ns))
        if is_chosen_row and int(row[1]) not in [body.id for body in moments[-1].bodies]:
            joints, confidence = mask_missing(row[2:].reshape(20, 3), np.full(20, TRACKED))
            moments[-1].bodies.append(Body(int(row[1]), joints, confidence))
    return moments


def _choose_device(devices: Counter[str], requested_device: str | None, path: Path) -> str:
    """Returns the Kinect to read.

    If several Kinects have the same number of rows, the first one in the file is used.
    """
    if not devices:
        raise InputError("the file contains a header, but no rows", where=str(path))
    if requested_device is None:
        return devices.most_common(1)[0][0]
    if requested_device not in devices:
        raise InputError(
            f"the file contains no Kinect {requested_device!r}",
            where=str(path),
            remedy=f"Kinects in the file: {', '.join(sorted(devices))}.",
        )
    return requested_device
