"""Kinect v2 skeletons as the LabanotationSuite's gesture tools write them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.person import Body
from enliven_edge.importing.base import DEFAULT_OPTIONS, ImportOptions, Reader, head_of, only_one
from enliven_edge.importing.skeletons import (
    CONFIDENCE_OF_STATE,
    KINECT2_ORDER,
    WORLD_FROM_KINECT_SPACE,
    SkeletonMoment,
    frames_in_world,
    observed,
)
from enliven_edge.importing.tables import are_numbers, first_lines, numbers_of, rows_of

_COLUMNS = 101
"""Numbers of a row: the time, then x, y, z and the tracking state of 25 joints."""
_TICK_NS = 100
"""Nanoseconds of a tick, the Kinect SDK 2's unit of time."""


class LabanotationReader(Reader):
    """No header; 101 values a row: time in 100 ns ticks, then 25 joints of x, y, z, tracking state."""

    name = "labanotation"
    description = "Kinect v2 skeleton CSV of the LabanotationSuite (time, 25 joints with tracking states)"
    note = ""

    def can_read(self, paths: Sequence[Path]) -> bool:
        return any(_matches(path) for path in paths)

    def read(self, paths: Sequence[Path], options: ImportOptions = DEFAULT_OPTIONS) -> Iterator[BodyFrame]:
        path = only_one([path for path in paths if _matches(path)] or paths)
        values = numbers_of(rows_of(path), path, _COLUMNS)
        joints = values[:, 1:].reshape(-1, 25, 4)[:, KINECT2_ORDER]
        states = joints[..., 3]
        if not np.isin(states, (0.0, 1.0, 2.0)).all() or not np.isfinite(values[:, 0]).all():
            raise InputError("a tracking state is not 0, 1 or 2, or a time is missing", where=str(path))
        confidence = CONFIDENCE_OF_STATE[states.astype(int)]
        moments = [
            SkeletonMoment(int(ticks) * _TICK_NS, [Body(0, *observed(xyz, seen))])
            for ticks, xyz, seen in zip(values[:, 0], joints[..., :3], confidence, strict=True)
        ]
        return frames_in_world(moments, options.device or "kinect2", WORLD_FROM_KINECT_SPACE, str(path))


def _matches(path: Path) -> bool:
    cells = (first_lines(head_of(path), 1) or [""])[0].rstrip(",").split(",")
    return len(cells) == _COLUMNS and are_numbers(cells)
