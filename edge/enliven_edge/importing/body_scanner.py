"""The Kinect v2 joints that BodyScanner-Kinect keeps beside a scan: one moment, tilted sensor."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.person import Body
from enliven_edge.importing.base import DEFAULT_OPTIONS, ImportOptions, Reader, head_of, only_one
from enliven_edge.importing.skeletons import KINECT2_NAMES, TRACKED, SkeletonMoment, frames_in_world, observed
from enliven_edge.importing.tables import first_lines, numbers_of, rows_of

_HEADER = ["Joints", "X", "Y", "Z"]
_TILT = "Degree"


class BodyScannerReader(Reader):
    """``Joints,X,Y,Z``; the row ``Degree`` is the sensor's tilt, then 25 joints, +Y up, +Z to the sensor."""

    name = "body-scanner"
    description = "BodyScanner-Kinect CSV (the joints of one moment, with the sensor's tilt)"
    note = "one moment only; every joint counts as tracked"

    def can_read(self, paths: Sequence[Path]) -> bool:
        return any(_matches(path) for path in paths)

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[BodyFrame]:
        path = only_one([path for path in paths if _matches(path)] or paths)
        rows = rows_of(path)[1:]
        values = numbers_of([row[1:] for row in rows], path, 3, 2)
        named = {row[0].strip(): xyz for row, xyz in zip(rows, values, strict=False)}
        missing = [name for name in (_TILT, *KINECT2_NAMES) if name not in named]
        if missing:
            raise InputError(f"the row {missing[0]} is missing", where=str(path))
        joints = np.array([named[name] for name in KINECT2_NAMES])
        body = Body(0, *observed(joints, np.full(len(joints), TRACKED)))
        level = level_from_tilted(math.radians(float(named[_TILT][0])))
        return frames_in_world([SkeletonMoment(0, [body])], options.device or "kinect2", level, str(path))


def level_from_tilted(tilt: float) -> Float:
    """(3, 3) takes the space of a sensor that points ``tilt`` radians down to a level one."""
    c, s = math.cos(tilt), math.sin(tilt)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _matches(path: Path) -> bool:
    rows = [line.split(",") for line in first_lines(head_of(path), 2)]
    return len(rows) == 2 and rows[0] == _HEADER and rows[1][0] == _TILT
